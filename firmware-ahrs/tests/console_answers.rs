//! What the console says when it is asked, and what it counts.

use firmware_ahrs::console::Asked;
use firmware_ahrs::{Ahrs, AhrsConfig, Console, Done, Heard, Inputs, Job, Readings};
use frame::message::SettingsNews;
use frame::{Command, Event, ImuCommand, Message, Refusals};

fn console() -> Console {
    Console::new(AhrsConfig::default(), Ahrs::hello(168_000_000, 0, 7), None)
}

/// One tick without a sensor: what is said, and the job.
fn ask(console: &mut Console, heard: Option<Command>, done: Option<Done>) -> (Vec<Message>, Option<Job>) {
    let mut said = Vec::new();
    let asked = Asked { heard: heard.map(Heard::Command), done, ..Asked::default() };
    let job = console.tick(&Inputs::default(), &asked, &mut |_, message| said.push(*message));
    (said, job)
}

#[test]
fn the_first_words_say_who_speaks_and_what_was_stored() {
    let mut said = Vec::new();
    console().greet(SettingsNews::Absent, &mut |_, message| said.push(*message));
    console().announce(Event::Accepted, &mut |_, message| said.push(*message));
    let hello = Message::Hello(Ahrs::hello(168_000_000, 0, 7));
    assert_eq!(said, [hello, Message::Event(Event::Settings(SettingsNews::Absent)), Message::Event(Event::Accepted)]);
}

/// A ping needs no words; who is asked for its name gives it, with the sensors that live now.
#[test]
fn a_ping_is_silent_and_a_name_is_told() {
    let mut console = console();
    assert_eq!(ask(&mut console, Some(Command::Ping), None), (vec![], None));
    let hello = Message::Hello(Ahrs::hello(168_000_000, 0, 0));
    assert_eq!(ask(&mut console, Some(Command::Identify), None), (vec![hello], None));
}

/// While the flash is at work nothing else may begin.
#[test]
fn one_job_at_a_time() {
    let mut console = console();
    let save = Some(Command::Imu(ImuCommand::Save));
    assert!(matches!(ask(&mut console, save, None), (_, Some(Job::Save(_)))));
    let refused = Message::Event(Event::Refused(Refusals(Refusals::WRONG_STATE)));
    assert_eq!(ask(&mut console, save, None), (vec![refused], None));
    let (said, job) = ask(&mut console, save, Some(Done::Saved(SettingsNews::Saved)));
    assert_eq!(said, [Message::Event(Event::Settings(SettingsNews::Saved))]);
    assert!(job.is_some());
}

/// Each lost reading and each one at its end is counted for its sensor and for no other.
#[test]
fn losses_are_counted_by_sensor() {
    let mut console = console();
    for lost in [0b0101, 0b0100, 0b1000] {
        let accel = Some([i16::MAX, 0, 0]);
        let inputs = Inputs { readings: Readings { lost, accel, ..Readings::default() }, ..Inputs::default() };
        console.tick(&inputs, &Asked::default(), &mut |_, _| {});
    }
    assert_eq!((console.errors().lost, console.errors().saturated), ([1, 0, 2, 1], [0, 3, 0]));
}
