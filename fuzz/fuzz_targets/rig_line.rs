#![no_main]
quadrig_fuzz::fuzzed!(rig_line);
