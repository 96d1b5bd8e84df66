//! A fuzzer for our parsers: valid files are damaged in many ways, and no damage may do harm.
//!
//! A parser may refuse an input or accept it. It may not panic, hold more than 256 MB at a time or take more than a second
//! of processor time, and what it accepts must be fit for use: the reader that each parser's test hands in uses it. An
//! input that is accepted, or refused for a reason not seen before, is kept and damaged further: that finds its way into
//! parsers as a measured coverage would, without its tools.
//!
//! The inputs are the same each time. `CANTER_FUZZ_INPUTS` sets how many each parser gets; with `--nocapture` each prints
//! a line about them.
#![allow(dead_code, reason = "each user takes its part")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

/// Inputs of each parser where the environment does not say.
const NUM_INPUTS: u64 = 3000;

/// Memory that a parser may hold at a time, beyond what was held before it [bytes].
const MAX_MEMORY: isize = 256 << 20;

/// Processor time that a parser may take for one input.
const MAX_CPU: Duration = Duration::from_secs(1);

/// Longest input that one damage after the other may make of a file.
const MAX_LEN: usize = 1 << 15;

/// One input in so many is made long: as deep or as wide as a file may be.
const LONG_EVERY: usize = 2000;

/// Length of those [bytes].
const LONG_LEN: usize = 1 << 20;

/// Accepted inputs that are kept at most, and refused ones.
const MAX_KEPT: usize = 500;

/// Failures after which a parser's test gives up.
const MAX_FAILURES: usize = 8;

/// Numbers that are written in unusual ways or lie at an end of some range.
pub const NUMBERS: [&str; 34] = [
    "0",
    "-0",
    "-0.0",
    "1",
    "-1",
    "0.5",
    "1e9",
    "-1e9",
    "1e20",
    "3.4e38",
    "1e39",
    "1e308",
    "-1e308",
    "1e999",
    "-1e999",
    "5e-324",
    "1e-400",
    "1e-300",
    "2147483648",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "00",
    "1.",
    ".5",
    "1e",
    "0x10",
    "1_0",
    "nan",
    "inf",
    "99999999999999999999999999999999999999999999",
];

/// What TOML is made of.
pub const TOML: [&str; 44] = [
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "=",
    " = ",
    ".",
    ",",
    "\"",
    "\"\"\"",
    "'",
    "'''",
    "#",
    "\n",
    "\r\n",
    "\\",
    "\\u0000",
    "\\uD800",
    "\\U0010FFFF",
    "true",
    "false",
    "nan",
    "-inf",
    "1e999",
    "0x",
    "0xffffffffffffffffffff",
    "0o7",
    "0b1",
    "1979-05-27",
    "07:32:00",
    "1979-05-27T00:32:00.999999-07:00",
    "kind = \"sine\"\n",
    "[policy]\n",
    "[[legs]]\n",
    "a.b.c.d.e.f = 1\n",
    "\"\" = 1\n",
    "[a]\n[a.b]\n[a]\n",
    "legs = []\n",
    "gaits = [{}]\n",
    "name = \"\"\n",
    "\u{feff}",
    "\u{202e}",
];

/// What JSON is made of.
pub const JSON: [&str; 30] = [
    "[",
    "]",
    "{",
    "}",
    ":",
    ",",
    "\"",
    "\\",
    "\\u0000",
    "\\ud800",
    "\\udc00",
    "\\ud83d\\ude00",
    "null",
    "true",
    "false",
    "{}",
    "[]",
    "\"\"",
    "[[]]",
    "1e999",
    "-",
    "\n",
    "\u{feff}",
    "\u{0}",
    "\"version\":1,",
    "\"version\":2,",
    "NaN",
    "/*",
    "<script>",
    "</script>",
];

/// What the header of a safetensors file is made of, beside JSON.
pub const TENSORS: [&str; 22] = [
    "__metadata__",
    "\"canter\"",
    "\"dtype\"",
    "\"shape\"",
    "\"data_offsets\"",
    "\"F32\"",
    "\"F64\"",
    "\"U64\"",
    "\"BOOL\"",
    "\"F4\"",
    "\"BF16\"",
    "[0,0]",
    "[18446744073709551615,2]",
    "[4294967296,4294967296]",
    "[0,9223372036854775807]",
    "[1,1,1,1,1,1,1,1]",
    "checksum",
    "\"parameters\"",
    "\\u0000",
    "[[",
    "null",
    "{}",
];

/// Counts what each thread holds.
struct CountingAllocator;

thread_local! {
    /// Bytes that this thread has taken and not given back; those that another thread took count against it.
    static HELD: Cell<isize> = const { Cell::new(0) };
    /// Most of them since [`forget_peak`].
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn count(bytes: isize) {
    let held = HELD.get() + bytes;
    HELD.set(held);
    PEAK.set(PEAK.get().max(held));
}

// SAFETY: every call goes to the system's allocator as it came; the counters are plain numbers of the thread.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count(new_size as isize - layout.size() as isize);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }
}

/// Starts counting anew; returns what is held now.
fn forget_peak() -> isize {
    PEAK.set(HELD.get());
    HELD.get()
}

/// Processor time of this thread alone, so that a busy machine does not count; always 0 where the system does not tell.
struct Stopwatch {
    #[cfg(target_os = "linux")]
    statistics: Option<std::fs::File>,
}

impl Stopwatch {
    fn new() -> Self {
        Self {
            #[cfg(target_os = "linux")]
            statistics: std::fs::File::open("/proc/thread-self/schedstat").ok(),
        }
    }

    #[cfg(target_os = "linux")]
    fn now(&self) -> Duration {
        use std::os::unix::fs::FileExt;
        let nanoseconds = || {
            let mut text = [0; 64];
            let length = self.statistics.as_ref()?.read_at(&mut text, 0).ok()?;
            std::str::from_utf8(&text[..length]).ok()?.split(' ').next()?.parse().ok()
        };
        Duration::from_nanos(nanoseconds().unwrap_or(0))
    }

    #[cfg(not(target_os = "linux"))]
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// SplitMix64, Steele et al. 2014.
pub struct Random(u64);

impl Random {
    /// The numbers of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A whole number below `bound`; 0 for a bound of 0.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.bits()) * bound as u128) >> 64) as usize
    }

    /// Whether something happens that happens once in `times`.
    pub fn once_in(&mut self, times: usize) -> bool {
        self.below(times) == 0
    }

    /// One of these.
    pub fn one_of<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        &choices[self.below(choices.len())]
    }

    /// A range within `len` places: anywhere, mostly short.
    fn range(&mut self, len: usize) -> std::ops::Range<usize> {
        let start = self.below(len + 1);
        let longest = if self.once_in(4) { len } else { 16 };
        let end = (start + self.below(longest + 1)).min(len);
        start..end
    }
}

/// Damages bytes once or several times. `other` is spliced in; `tokens` are words of the format.
pub fn damage(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8], tokens: &[&str]) {
    let times = if random.once_in(2) { 1 } else { 1 + random.below(6) };
    for _ in 0..times {
        damage_once(random, bytes, other, tokens);
        bytes.truncate(MAX_LEN);
    }
    if random.once_in(LONG_EVERY) {
        lengthen(random, bytes, tokens);
    }
}

fn damage_once(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8], tokens: &[&str]) {
    const INTERESTING: &[u8] = b"\0\x01\x7f\x80\xc0\xe2\xef\xff\"'\\[]{}(),.:;=#-+_ \t\r\n/09aeExXuUnNiItf";
    let len = bytes.len();
    let place = random.below(len);
    match random.below(18) {
        0 if len > 0 => bytes[place] ^= 1 << random.below(8),
        1 if len > 0 => bytes[place] = *random.one_of(INTERESTING),
        2 => bytes.truncate(place),
        3 => {
            bytes.drain(random.range(len));
        }
        4 => {
            let block = bytes[random.range(len)].to_vec();
            let most = if random.once_in(8) { 200 } else { 2 };
            let times = 1 + random.below(most);
            let at = random.below(len + 1);
            bytes.splice(at..at, block.repeat(times));
        }
        5 => {
            let block = &other[random.range(other.len())];
            let replaced = random.range(len);
            bytes.splice(replaced, block.iter().copied());
        }
        6 => {
            let noise: Vec<u8> = (0..=random.below(8)).map(|_| random.bits() as u8).collect();
            bytes.splice(place..place, noise);
        }
        7 | 8 => {
            let token = random.one_of(tokens).as_bytes();
            let times = if random.once_in(20) { 1 + random.below(300) } else { 1 };
            bytes.splice(place..place, token.repeat(times));
        }
        9 | 10 | 15..=17 => replace_number(random, bytes, place),
        11 => replace_text(random, bytes, place, tokens),
        12 => {
            // A line goes or comes twice.
            let start = bytes[..place].iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
            let end = bytes[place..].iter().position(|&byte| byte == b'\n').map_or(len, |newline| place + newline + 1);
            let line = bytes.drain(start..end).collect::<Vec<_>>().repeat(2 * random.below(2));
            let at = random.below(bytes.len() + 1);
            bytes.splice(at..at, line);
        }
        13 if len >= 8 => {
            // A length or an offset.
            const WORDS: [u64; 8] = [0, 1, 7, 1 << 31, 1 << 32, u64::MAX >> 1, u64::MAX, 1 << 53];
            let start = if random.once_in(2) { 0 } else { random.below(len - 7) };
            let word = random.one_of(&WORDS).wrapping_add(random.below(3) as u64);
            bytes[start..start + 8].copy_from_slice(&word.to_le_bytes());
        }
        _ => {
            let longest = random.range(len);
            let with = *random.one_of(INTERESTING);
            bytes[longest].fill(with);
        }
    }
}

/// Puts an extreme number in the place of the next one after `place`.
fn replace_number(random: &mut Random, bytes: &mut Vec<u8>, place: usize) {
    let is_digit = |byte: &u8| byte.is_ascii_digit();
    let Some(start) = bytes[place..].iter().position(is_digit).map(|offset| place + offset) else { return };
    let is_part = |byte: &u8| byte.is_ascii_digit() || b".eE+-_".contains(byte);
    let end = bytes[start..].iter().position(|byte| !is_part(byte)).map_or(bytes.len(), |length| start + length);
    let start = if start > 0 && bytes[start - 1] == b'-' { start - 1 } else { start };
    bytes.splice(start..end, random.one_of(&NUMBERS).bytes());
}

/// Puts something else in the place of the next text in quotation marks after `place`.
fn replace_text(random: &mut Random, bytes: &mut Vec<u8>, place: usize, tokens: &[&str]) {
    let quote = |from: usize| bytes[from..].iter().position(|&byte| byte == b'"').map(|offset| from + offset);
    let Some(start) = quote(place) else { return };
    let Some(end) = quote(start + 1) else { return };
    let text = match random.below(4) {
        0 => String::new(),
        1 => "x".repeat(random.below(6000)),
        2 => (*random.one_of(tokens)).to_owned(),
        _ => "../../\u{e4}\u{1f415}".to_owned(),
    };
    bytes.splice(start + 1..end, text.bytes());
}

/// Repeats a token, or the whole input, to the length of a large file.
fn lengthen(random: &mut Random, bytes: &mut Vec<u8>, tokens: &[&str]) {
    let piece = if random.once_in(3) { bytes.clone() } else { random.one_of(tokens).as_bytes().to_vec() };
    let times = LONG_LEN / piece.len().max(1);
    let at = if random.once_in(2) { 0 } else { random.below(bytes.len() + 1) };
    bytes.splice(at..at, piece.repeat(times));
}

/// What happened to a parser's inputs.
#[derive(Default)]
struct Totals {
    accepted: u64,
    reasons: HashSet<u64>,
    longest: Duration,
    largest: isize,
}

/// Hands damaged inputs to `read`, which returns why it refuses one, or accepts it and uses it.
///
/// `make` damages a valid or a kept input; it gets another one to take parts from.
///
/// # Panics
/// If an input makes `read` panic, or take more memory or time than it may.
pub fn fuzz(
    name: &str,
    valid: &[Vec<u8>],
    mut make: impl FnMut(&mut Random, &[u8], &[u8]) -> Vec<u8>,
    mut read: impl FnMut(&[u8], &mut Random) -> Result<(), String>,
) {
    let num_inputs = std::env::var("CANTER_FUZZ_INPUTS")
        .map_or(NUM_INPUTS, |text| text.parse().expect("CANTER_FUZZ_INPUTS is a whole number"));
    let mut random = Random::new(1);
    for input in valid {
        read(input, &mut random).unwrap_or_else(|reason| panic!("{name}: a valid file is refused: {reason}"));
    }
    let stopwatch = Stopwatch::new();
    let (mut accepted, mut refused) = (Vec::<Vec<u8>>::new(), Vec::<Vec<u8>>::new());
    let (mut totals, mut failures, mut seen_failures) = (Totals::default(), Vec::new(), HashSet::new());
    for number in 0..num_inputs {
        let input = {
            let pick = |random: &mut Random| match random.below(4) {
                0 if !refused.is_empty() => &refused[random.below(refused.len())],
                1 if !accepted.is_empty() => &accepted[random.below(accepted.len())],
                _ => random.one_of(valid),
            };
            let (base, other) = (pick(&mut random), pick(&mut random));
            make(&mut random, base, other)
        };
        let (start, held) = (stopwatch.now(), forget_peak());
        let result = catch_unwind(AssertUnwindSafe(|| read(&input, &mut random)));
        let (taken, memory) = (stopwatch.now() - start, PEAK.get() - held);
        totals.longest = totals.longest.max(taken);
        totals.largest = totals.largest.max(memory);
        let failure = match &result {
            Err(panic) => Some(format!("it panics: {}", panic_message(&**panic))),
            Ok(_) if memory > MAX_MEMORY => Some(format!("it holds {} MB", memory >> 20)),
            Ok(_) if taken > MAX_CPU => Some(format!("it takes {taken:.1?}")),
            Ok(_) => None,
        };
        match result {
            Ok(Ok(())) => {
                totals.accepted += 1;
                if input.len() <= MAX_LEN {
                    keep(&mut accepted, &input, &mut random);
                }
            }
            Ok(Err(reason)) => {
                if totals.reasons.insert(essence(&reason)) && input.len() <= MAX_LEN {
                    keep(&mut refused, &input, &mut random);
                }
            }
            Err(_) => {}
        }
        if let Some(failure) = failure.filter(|failure| seen_failures.insert(essence(failure))) {
            let path = std::env::temp_dir().join(format!("canter-fuzz-{}-{number}", name.replace(' ', "-")));
            std::fs::write(&path, &input).expect("the folder for temporary files can be written");
            let shown = input[..input.len().min(300)].escape_ascii();
            failures.push(format!("input {number}, {}: {failure}\n    {shown}", path.display()));
        }
        if failures.len() == MAX_FAILURES {
            break;
        }
    }
    println!(
        "{name}: {num_inputs} inputs, {} accepted, {} reasons to refuse, at most {} ms and {} kB",
        totals.accepted,
        totals.reasons.len(),
        totals.longest.as_millis(),
        totals.largest >> 10
    );
    assert!(failures.is_empty(), "{name}:\n{}", failures.join("\n"));
}

/// Keeps an input, in the place of another one where there are many.
fn keep(kept: &mut Vec<Vec<u8>>, input: &[u8], random: &mut Random) {
    if kept.len() < MAX_KEPT {
        kept.push(input.to_vec());
    } else {
        kept[random.below(MAX_KEPT)] = input.to_vec();
    }
}

/// [`fuzz`] with [`damage`] alone.
pub fn fuzz_bytes(
    name: &str,
    valid: &[Vec<u8>],
    tokens: &[&str],
    mut read: impl FnMut(&[u8], &mut Random) -> Result<(), String>,
) {
    let make = |random: &mut Random, base: &[u8], other: &[u8]| {
        let mut bytes = base.to_vec();
        damage(random, &mut bytes, other, tokens);
        bytes
    };
    fuzz(name, valid, make, &mut read);
}

fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message").to_owned()
}

/// A hash of a message without what it quotes and without its numbers: the same for the same reason.
fn essence(message: &str) -> u64 {
    use std::hash::{DefaultHasher, Hash, Hasher};
    const MAX_LETTERS: usize = 100;
    let mut hasher = DefaultHasher::new();
    let mut quote = None;
    let mut num_letters = 0;
    for character in message.chars() {
        match quote {
            Some(end) if end == character => quote = None,
            Some(_) => {}
            None if character == '"' || character == '`' => quote = Some(character),
            None if character.is_ascii_alphabetic() => {
                character.hash(&mut hasher);
                num_letters += 1;
            }
            None => {}
        }
        if num_letters == MAX_LETTERS {
            break;
        }
    }
    hasher.finish()
}
