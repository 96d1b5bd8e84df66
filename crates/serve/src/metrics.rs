//! The lines of `metrics.jsonl`, as they come.

use std::io::{self, Read, Seek, SeekFrom};

use serde::de::IgnoredAny;

use crate::folder::{Place, Refusal};

/// The file's name in a run directory.
pub const NAME: &str = "metrics.jsonl";

/// So much of the file is in one answer [bytes].
const MAX_BYTES: u64 = 2 << 20;

/// Whole lines from byte `from` on, as JSON: `from`, `next`, `more`, `broken`, `lines`.
///
/// `from` in the answer is 0 where the file does not have the end of a line before the byte that was asked for: it was cut,
/// or written anew.
///
/// # Errors
/// If the file cannot be read. Before the first line there is none, which is no error.
pub fn since(run: &Place, from: u64) -> Result<String, Refusal> {
    let mut file = match run.open(NAME) {
        Err(Refusal::File(_, error)) if error.kind() == io::ErrorKind::NotFound => return Ok(answer(0, 0, false, &[])),
        file => file?,
    };
    read_since(&mut file, from).map_err(|error| Refusal::File(NAME.to_owned(), error))
}

fn read_since(file: &mut (impl Read + Seek), from: u64) -> io::Result<String> {
    let end = file.seek(SeekFrom::End(0))?;
    let from = if from <= end && is_after_a_line(file, from)? { from } else { 0 };
    file.seek(SeekFrom::Start(from))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES).read_to_end(&mut bytes)?;
    let is_full = bytes.len() as u64 == MAX_BYTES;
    let whole = match bytes.iter().rposition(|&byte| byte == b'\n') {
        Some(position) => &bytes[..=position],
        // A line of this length is none of ours: passed over, piece by piece.
        None if is_full => &bytes[..],
        None => &[],
    };
    let next = from + whole.len() as u64;
    Ok(answer(from, next, is_full && next < end, whole))
}

fn is_after_a_line(file: &mut (impl Read + Seek), from: u64) -> io::Result<bool> {
    let Some(before) = from.checked_sub(1) else { return Ok(true) };
    file.seek(SeekFrom::Start(before))?;
    let mut byte = [0];
    file.read_exact(&mut byte)?;
    Ok(byte == *b"\n")
}

fn answer(from: u64, next: u64, more: bool, whole: &[u8]) -> String {
    let mut lines = Vec::new();
    let mut broken = 0;
    for line in whole.split(|&byte| byte == b'\n').filter(|line| !line.is_empty()) {
        match as_json(line) {
            Some(line) => lines.push(line),
            None => broken += 1,
        }
    }
    let lines = lines.join(",");
    format!(r#"{{"from":{from},"next":{next},"more":{more},"broken":{broken},"lines":[{lines}]}}"#)
}

/// A line, if it is JSON.
pub fn as_json(line: &[u8]) -> Option<&str> {
    let line = std::str::from_utf8(line).ok()?;
    serde_json::from_str::<IgnoredAny>(line).ok().map(|_| line)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use serde_json::{Value, json};

    use super::*;

    fn read(content: &[u8], from: u64) -> Value {
        let answer = read_since(&mut Cursor::new(content), from).unwrap();
        serde_json::from_str(&answer).unwrap()
    }

    #[test]
    fn what_has_no_end_yet_waits() {
        let expected = json!({"from": 0, "next": 8, "more": false, "broken": 0, "lines": [{"a": 1}]});
        assert_eq!(read(b"{\"a\":1}\n{\"a\":", 0), expected);
        let expected = json!({"from": 8, "next": 16, "more": false, "broken": 0, "lines": [{"a": 2}]});
        assert_eq!(read(b"{\"a\":1}\n{\"a\":2}\n", 8), expected);
    }

    #[test]
    fn a_file_that_was_cut_is_read_from_its_start() {
        for from in [5, 16, 17, u64::MAX] {
            let answer = read(b"{\"a\":1}\n{\"a\":2", from);
            assert_eq!((&answer["from"], &answer["next"]), (&json!(0), &json!(8)), "from {from}");
        }
    }

    #[test]
    fn broken_lines_are_counted_and_passed_over() {
        let answer = read(b"{\"a\":1}\n\xff\xfe\nNaN\n{\"a\":}\n[1]\n", 0);
        assert_eq!(answer["broken"], json!(3));
        assert_eq!(answer["lines"], json!([{"a": 1}, [1]]));
    }

    #[test]
    fn a_line_without_end_is_passed_over() {
        let content = vec![b'x'; 2 * MAX_BYTES as usize + 3];
        let answer = read(&content, 0);
        assert_eq!((&answer["next"], &answer["more"]), (&json!(MAX_BYTES), &json!(true)));
    }
}
