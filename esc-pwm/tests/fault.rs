//! Faults and reasons: what is put into a set is in it and nothing else, and each says its own words.

use esc_pwm::{Fault, FaultSet, Refusals};
use std::collections::BTreeSet;

/// The bit of a fault is its place in the list: logs keep the bits.
#[test]
fn each_fault_is_a_bit_of_its_own() {
    for (bit, fault) in Fault::ALL.into_iter().enumerate() {
        let set = FaultSet::NONE.with(fault);
        assert_eq!((set.0, set.is_empty()), (1 << bit, false), "{fault:?}");
        assert!(Fault::ALL.into_iter().all(|other| set.contains(other) == (other == fault)), "{fault:?}");
        assert_eq!(set.with(fault), set, "twice is once");
    }
    assert!(FaultSet::NONE.is_empty());
}

/// A fault that joins leaves those that are latched, and they are told in the order of their bits.
#[test]
fn a_set_holds_what_was_put_into_it() {
    let set = FaultSet::NONE.with(Fault::StreamDry).with(Fault::LinkLost).with(Fault::OperatorStop);
    assert!(set.iter().eq([Fault::OperatorStop, Fault::LinkLost, Fault::StreamDry]));
    assert_eq!(set.to_string(), "operator's stop, link lost, schedule ran dry");
    assert_eq!(FaultSet::NONE.to_string(), "no fault");
}

#[test]
fn each_fault_and_each_reason_has_words_of_its_own() {
    let faults: BTreeSet<&str> = Fault::ALL.into_iter().map(Fault::words).collect();
    assert_eq!(faults.len(), Fault::ALL.len());
    let bits: BTreeSet<u16> = Refusals::WORDS.into_iter().map(|(bit, _)| bit).collect();
    let reasons: BTreeSet<&str> = Refusals::WORDS.into_iter().map(|(_, words)| words).collect();
    assert_eq!((bits.len(), reasons.len()), (16, 16));
    assert!(bits.into_iter().all(|bit| bit.is_power_of_two()));
}

/// An operator reads every reason that speaks against a command, and none that does not.
#[test]
fn a_refusal_says_its_reasons() {
    let two = Refusals::default().with_if(Refusals::ROTOR_TURNING, true).with_if(Refusals::FAULT_LATCHED, true);
    assert_eq!(two.to_string(), "a fault is latched: clear it first, the rotor turns");
    assert_eq!(two.with_if(Refusals::STOP_OPEN, false), two);
    assert_eq!(two.with_if(Refusals::ROTOR_TURNING, true), two, "twice is once");
    assert!(!two.is_empty() && Refusals::default().is_empty());
    for (bit, words) in Refusals::WORDS {
        assert_eq!(Refusals(bit).to_string(), words);
    }
}
