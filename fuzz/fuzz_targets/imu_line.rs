#![no_main]
quadrig_fuzz::fuzzed!(imu_line);
