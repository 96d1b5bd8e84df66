//! TensorBoard's event file: the scalars of `metrics.jsonl` over env steps.
//!
//! The file holds nothing that is not in `metrics.jsonl`, so it can be made again from there at any time. While a run is
//! trained it grows by one record an iteration.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use canter_sim::file;
use crc::{CRC_32_ISCSI, Crc};
use prost::Message;
use serde_json::Value;

use crate::run_directory::{MAX_LOG_BYTES, RunError, io_error, write_whole};

/// TensorBoard looks for names that hold `tfevents`.
const FILE_NAME: &str = "events.out.tfevents.canter";

/// What the first record of every event file says.
const FILE_VERSION: &str = "brain.Event:2";

/// The part of TensorFlow's `event.proto` that scalars need.
#[derive(Message)]
struct Event {
    /// Since 1970 for TensorFlow, since the training's start here [s].
    #[prost(double, tag = "1")]
    wall_time: f64,
    #[prost(int64, tag = "2")]
    step: i64,
    #[prost(string, optional, tag = "3")]
    file_version: Option<String>,
    #[prost(message, optional, tag = "5")]
    summary: Option<Summary>,
}

/// Of `summary.proto`.
#[derive(Message)]
struct Summary {
    #[prost(message, repeated, tag = "1")]
    values: Vec<Scalar>,
}

/// `Summary.Value` of `summary.proto`.
#[derive(Message)]
struct Scalar {
    #[prost(string, tag = "1")]
    tag: String,
    // Optional, because a plain field of value 0 would not be written.
    #[prost(float, optional, tag = "2")]
    simple_value: Option<f32>,
}

/// The event file of a run that is being trained.
#[derive(Debug)]
pub struct EventFile {
    path: PathBuf,
    file: File,
    encoder: Encoder,
}

impl EventFile {
    /// Opens the event file in `folder` to go on after the lines of `metrics`, the content of `metrics.jsonl`.
    ///
    /// What comes after them is cut off. A file that does not begin with them is replaced.
    ///
    /// # Errors
    /// The system's.
    pub(crate) fn open(folder: &Path, metrics: &str) -> Result<Self, RunError> {
        let path = folder.join(FILE_NAME);
        let mut encoder = Encoder::default();
        let mut bytes = Encoder::start();
        for line in metrics.lines().filter_map(|line| serde_json::from_str(line).ok()) {
            bytes.extend(encoder.encode(&line));
        }
        let present = match file::read(&path, MAX_LOG_BYTES) {
            Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
            present => present.map_err(|source| io_error(&path, source))?,
        };
        let can_stay = present.starts_with(&bytes);
        if !can_stay {
            write_whole(&path, &bytes)?;
        }
        let opened = OpenOptions::new().append(true).open(&path).and_then(|file| {
            // Cut in place, not replaced: a TensorBoard that has the file open follows the run.
            file.set_len(bytes.len() as u64)?;
            Ok(file)
        });
        let file = opened.map_err(|source| io_error(&path, source))?;
        Ok(Self { path, file, encoder })
    }

    /// Appends one line of `metrics.jsonl`.
    ///
    /// # Errors
    /// The system's.
    pub fn append(&mut self, metrics: &Value) -> Result<(), RunError> {
        let record = self.encoder.encode(metrics);
        self.file.write_all(&record).map_err(|source| io_error(&self.path, source))
    }
}

/// Turns lines of `metrics.jsonl` into records, in their order.
#[derive(Debug, Default)]
struct Encoder {
    /// Wall time that the training took so far [s].
    training_s: f64,
}

impl Encoder {
    /// The record that every file starts with.
    fn start() -> Vec<u8> {
        let version = Event { file_version: Some(FILE_VERSION.to_owned()), ..Event::default() };
        framed(&version.encode_to_vec())
    }

    /// The record of one line.
    fn encode(&mut self, metrics: &Value) -> Vec<u8> {
        let number = |key: &str| metrics[key].as_f64().unwrap_or(0.0);
        self.training_s += number("collect_s") + number("update_s");
        let event = Event {
            wall_time: self.training_s,
            step: metrics["env_steps"].as_i64().unwrap_or(0),
            file_version: None,
            summary: Some(Summary { values: scalars(metrics) }),
        };
        framed(&event.encode_to_vec())
    }
}

/// Every number of a line but the one that is the horizontal axis.
fn scalars(metrics: &Value) -> Vec<Scalar> {
    let mut scalars = Vec::new();
    let mut push = |group: &str, key: &str, value: &Value| {
        // A mean over nothing is null there and absent here.
        if let Some(value) = value.as_f64() {
            scalars.push(Scalar { tag: format!("{group}/{key}"), simple_value: Some(value as f32) });
        }
    };
    for (key, value) in metrics.as_object().into_iter().flatten().filter(|(key, _)| *key != "env_steps") {
        match value {
            Value::Object(members) => members.iter().for_each(|(member, value)| push(key, member, value)),
            _ => push(group(key), key, value),
        }
    }
    scalars
}

/// The section of TensorBoard's page that a number of a training stands in.
fn group(key: &str) -> &'static str {
    match key {
        "policy_loss" | "value_loss" | "entropy" | "approx_kl" | "clip_fraction" | "explained_variance"
        | "gradient_norm" | "learning_rate" => "loss",
        "collect_s" | "update_s" => "time",
        _ => "train",
    }
}

/// A record of a TFRecord file: length, its checksum, the bytes, their checksum; little-endian.
fn framed(bytes: &[u8]) -> Vec<u8> {
    let length = (bytes.len() as u64).to_le_bytes();
    [&length[..], &masked_crc(&length), bytes, &masked_crc(bytes)].concat()
}

/// CRC-32C, turned and shifted so that a record within a record has another one.
fn masked_crc(bytes: &[u8]) -> [u8; 4] {
    const CRC_32C: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);
    /// TensorFlow's choice: turn by 15 bits, add this.
    const MASK: u32 = 0xa282_ead8;
    const TURN_BITS: u32 = 15;
    CRC_32C.checksum(bytes).rotate_right(TURN_BITS).wrapping_add(MASK).to_le_bytes()
}
