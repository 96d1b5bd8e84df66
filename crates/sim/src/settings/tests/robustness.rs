//! No bytes make the reader panic.

use super::*;

/// A linear congruential generator (Knuth's MMIX constants); its high bits are random enough to break files.
struct Lcg(u64);

impl Lcg {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }
}

/// Everything that a file goes through; the result does not matter.
fn exercise(bytes: &[u8]) -> bool {
    let result = Document::parse("x.toml", bytes).and_then(|mut document| {
        document.set("legs[1].mount.position_m", "2");
        document.read_checked(|_: &AllSettings, problems| problems.at("legs[0].foot", "x"))
    });
    result.unwrap_err().to_string().starts_with("x.toml:")
}

#[test]
fn mutated_files_do_not_panic() {
    let mut random = Lcg(1);
    let pieces: [&[u8]; 16] = [
        b"[",
        b"]",
        b"[[",
        b"{",
        b"}",
        b"\"",
        b"'''",
        b"=",
        b".",
        b"\n",
        b"\xff",
        b"\xc3\xbc",
        b"e",
        b"-",
        b"0",
        b"\\u",
    ];
    for _ in 0..20_000 {
        let mut bytes = VALID.as_bytes().to_vec();
        for _ in 0..=random.below(4) {
            let at = random.below(bytes.len());
            match random.below(4) {
                0 => bytes[at] = random.below(256) as u8,
                1 => bytes.truncate(at + 1),
                2 => {
                    let end = (at + random.below(20)).min(bytes.len());
                    if end - at < bytes.len() {
                        bytes.drain(at..end);
                    }
                }
                _ => {
                    let piece = pieces[random.below(pieces.len())];
                    bytes.splice(at..at, piece.iter().copied());
                }
            }
        }
        exercise(&bytes);
    }
}

#[test]
fn random_bytes_do_not_panic() {
    let mut random = Lcg(2);
    for _ in 0..2_000 {
        let bytes: Vec<u8> = (0..random.below(64)).map(|_| random.below(256) as u8).collect();
        exercise(&bytes);
    }
}

#[test]
fn deep_nesting_is_refused() {
    let arrays = |depth: usize| format!("a = {}{}", "[".repeat(depth), "]".repeat(depth));
    // The root table is the first of the 32.
    assert!(Document::parse("x.toml", arrays(31).as_bytes()).is_ok());
    let report = Document::parse("x.toml", arrays(32).as_bytes()).unwrap_err().to_string();
    let path = format!("a{}", "[0]".repeat(31));
    assert_eq!(
        report,
        format!("x.toml:1:36: {path} is nested too deep: expected at most 32 tables and arrays inside each other")
    );
    for text in [arrays(100_000), "a = ".to_owned() + &"{a=".repeat(100_000), "a.".repeat(100_000) + "a = 1"] {
        assert!(exercise(text.as_bytes()));
    }
    let headers = format!("[{}a]\n{}b = {}1", "a.".repeat(60), "b.".repeat(60), "[".repeat(60));
    assert!(exercise(headers.as_bytes()));

    let mut document = Document::parse("x.toml", b"").unwrap();
    document.set(&"a.".repeat(100_000), "1");
    document.set(&vec!["a"; 40].join("."), "1");
    document.set("a", &"[".repeat(100_000));
    document.set(&vec!["a"; 20].join("."), "[[[[[[[[[[[[[1]]]]]]]]]]]]]");
    let problems = document.read::<AllSettings>().unwrap_err();
    assert_eq!(problems.iter().filter(|problem| problem.place.position.is_none()).count(), 5);
}

#[test]
fn large_files_of_mistakes_are_read() {
    let long_key = "k".repeat(4000);
    let files = [
        format!("widths = [{}]", "0,".repeat(500_000)),
        (0..100_000).map(|index| format!("k{index}=1\n")).collect(),
        format!("{long_key} = [{}]", "0,".repeat(500_000)),
        "[[legs]]\n".repeat(100_000),
        format!("a={}{}{}", "[".repeat(31), "[],".repeat(300_000), "]".repeat(31)),
    ];
    for file in files {
        assert!(exercise(file.as_bytes()));
    }
}
