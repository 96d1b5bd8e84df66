//! The event file, read back by a reader of its own: what it holds, and that no step is there twice.

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use canter_train::run_directory::RunDirectory;
use common::TemporaryFolder;
use serde_json::Value;

const EVENT_FILE: &str = "events.out.tfevents.canter";

/// CRC-32C bit by bit, from its polynomial.
fn crc_32c(bytes: &[u8]) -> u32 {
    let mut crc = !0_u32;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0x82f6_3b78 } else { crc >> 1 };
        }
    }
    !crc
}

fn masked(bytes: &[u8]) -> u32 {
    let crc = crc_32c(bytes);
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// The records of a TFRecord file.
fn records(mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut records = Vec::new();
    while !bytes.is_empty() {
        let (head, rest) = bytes.split_at(8);
        let length = u64::from_le_bytes(head.try_into().unwrap()) as usize;
        let number = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap());
        assert_eq!(number(&rest[..4]), masked(head));
        let record = &rest[4..4 + length];
        assert_eq!(number(&rest[4 + length..8 + length]), masked(record));
        records.push(record);
        bytes = &rest[8 + length..];
    }
    records
}

/// One field of a protobuf message.
#[derive(Debug, PartialEq)]
enum Field<'a> {
    Varint(u64),
    Double(f64),
    Float(f32),
    Bytes(&'a [u8]),
}

fn varint(bytes: &mut &[u8]) -> u64 {
    let mut value = 0;
    for place in 0.. {
        let byte = bytes[0];
        *bytes = &bytes[1..];
        value |= u64::from(byte & 0x7f) << (7 * place);
        if byte < 0x80 {
            break;
        }
    }
    value
}

/// The fields of a protobuf message, with their numbers.
fn fields(mut bytes: &[u8]) -> Vec<(u64, Field<'_>)> {
    let mut fields = Vec::new();
    while !bytes.is_empty() {
        let key = varint(&mut bytes);
        let field = match key & 7 {
            0 => Field::Varint(varint(&mut bytes)),
            wire_type => {
                let length = match wire_type {
                    1 => 8,
                    2 => varint(&mut bytes) as usize,
                    5 => 4,
                    other => panic!("wire type {other}"),
                };
                let (content, rest) = bytes.split_at(length);
                bytes = rest;
                match wire_type {
                    1 => Field::Double(f64::from_le_bytes(content.try_into().unwrap())),
                    5 => Field::Float(f32::from_le_bytes(content.try_into().unwrap())),
                    _ => Field::Bytes(content),
                }
            }
        };
        fields.push((key >> 3, field));
    }
    fields
}

#[derive(Debug, Default, PartialEq)]
struct Event {
    wall_time: f64,
    step: u64,
    file_version: Option<String>,
    scalars: BTreeMap<String, f32>,
}

fn event(record: &[u8]) -> Event {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let mut event = Event::default();
    for field in fields(record) {
        match field {
            (1, Field::Double(wall_time)) => event.wall_time = wall_time,
            (2, Field::Varint(step)) => event.step = step,
            (3, Field::Bytes(version)) => event.file_version = Some(text(version)),
            (5, Field::Bytes(summary)) => {
                for value in fields(summary) {
                    let (1, Field::Bytes(value)) = value else { panic!("{value:?}") };
                    let [(1, Field::Bytes(tag)), (2, Field::Float(number))] = fields(value)[..] else {
                        panic!("{value:?}")
                    };
                    assert_eq!(event.scalars.insert(text(tag), number), None, "a tag comes twice");
                }
            }
            other => panic!("{other:?}"),
        }
    }
    event
}

fn events(run: &Path) -> Vec<Event> {
    records(&fs::read(run.join(EVENT_FILE)).unwrap()).into_iter().map(event).collect()
}

/// What the file has to hold, from `metrics.jsonl`.
fn assert_holds_the_metrics(run: &Path, lines: usize) {
    let text = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let metrics: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let events = events(run);
    let start = Event { file_version: Some("brain.Event:2".to_owned()), ..Event::default() };
    assert_eq!((metrics.len(), events.len(), &events[0]), (lines, lines + 1, &start));
    let mut wall_time = 0.0;
    for (line, event) in metrics.iter().zip(&events[1..]) {
        assert_eq!((Some(event.step), &event.file_version), (line["env_steps"].as_u64(), &None));
        wall_time += line["collect_s"].as_f64().unwrap() + line["update_s"].as_f64().unwrap();
        assert_eq!(event.wall_time, wall_time);
        let mut numbers = 0;
        for (tag, value) in &event.scalars {
            let (group, key) = tag.split_once('/').unwrap();
            let expected = if group == "accidents" { &line[group][key] } else { &line[key] };
            assert_eq!(Some(*value), expected.as_f64().map(|value| value as f32), "{tag}");
            numbers += 1;
        }
        // Every number has its curve, but for the axis; the one object holds the four kinds of accidents.
        let missing = line.as_object().unwrap().values().filter(|value| value.is_null()).count();
        assert_eq!(numbers, line.as_object().unwrap().len() - missing - 2 + 4, "{line}");
    }
}

#[test]
fn the_reader_knows_the_published_check_value() {
    assert_eq!(crc_32c(b"123456789"), 0xe306_9283);
}

#[test]
fn the_file_holds_every_number_of_the_metrics() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[("training.max_env_steps", "1280")], 2, None);
    assert_holds_the_metrics(&run, 10);
    let events = events(&run);
    let tags: Vec<_> = events[10].scalars.keys().map(String::as_str).collect();
    for tag in ["train/speed_m_per_s", "train/episode_return", "loss/value_loss", "time/collect_s"] {
        assert!(tags.contains(&tag), "{tag} is not in {tags:?}");
    }
    assert_eq!(events[1].scalars["accidents/unstable"], 0.0);
    // An episode lasts 50 steps, an iteration 32: nothing is known after the first one, and nothing is shown.
    let is_known: Vec<_> = events.iter().map(|event| event.scalars.contains_key("train/episode_return")).collect();
    assert_eq!(is_known[..3], [false, false, true]);
}

#[test]
fn a_stopped_run_goes_on_in_the_same_file() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[], 2, Some(2));
    assert_holds_the_metrics(&run, 2);
    let stopped = fs::read(run.join(EVENT_FILE)).unwrap();
    common::resume_in(&run, 1, None);
    assert_holds_the_metrics(&run, 5);
    assert!(fs::read(run.join(EVENT_FILE)).unwrap().starts_with(&stopped));
    // Nothing left to train: nothing changes.
    let finished = fs::read(run.join(EVENT_FILE)).unwrap();
    common::resume_in(&run, 1, None);
    assert!(fs::read(run.join(EVENT_FILE)).unwrap() == finished);
}

#[test]
fn steps_after_the_checkpoint_are_cut_off_before_they_come_again() {
    let folder = TemporaryFolder::new();
    let run = folder.join("run");
    common::run_in(&run, &[], 2, None);
    let whole = fs::read(run.join(EVENT_FILE)).unwrap();
    // As if the process had been killed in iteration 5, in the middle of writing its record.
    fs::remove_file(run.join("checkpoints/00000005.safetensors")).unwrap();
    let steps = |run: &Path| events(run).iter().map(|event| event.step).collect::<Vec<_>>();
    for present in [&whole[..], &whole[..whole.len() - 5], b"damaged", b""] {
        fs::write(run.join(EVENT_FILE), present).unwrap();
        // What `resume` does, up to its first iteration.
        let directory = RunDirectory::open(&run).unwrap();
        directory.truncate_metrics(4).unwrap();
        drop(directory.open_events().unwrap());
        assert_holds_the_metrics(&run, 4);
        assert!(whole.starts_with(&fs::read(run.join(EVENT_FILE)).unwrap()));
    }
    // A run of an earlier version has no such file: it gets one with all its steps.
    fs::remove_file(run.join(EVENT_FILE)).unwrap();
    common::resume_in(&run, 2, None);
    assert_holds_the_metrics(&run, 5);
    assert_eq!(steps(&run), [0, 128, 256, 384, 512, 640]);
}
