#![no_main]
quadrig_fuzz::fuzzed!(flight_log);
