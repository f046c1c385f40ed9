#![no_main]
quadrig_fuzz::fuzzed!(wire);
