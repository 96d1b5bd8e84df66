//! Valid files, and every kind of problem.

use super::*;
use crate::settings::ProblemKind;

#[test]
fn valid_file_is_read() {
    let settings = read(VALID).unwrap();
    assert_eq!(settings.gamma, 0.99);
    assert_eq!(settings.clip_epsilon, None);
    assert_eq!(settings.seed, u64::MAX);
    assert_eq!(settings.offset, -3);
    assert_eq!(settings.num_envs, 16);
    assert_eq!(settings.learning_rate, 1.0);
    assert_eq!(settings.label, "a \"b\" \u{7f} ü");
    assert_eq!(settings.footfall, Footfall::Trot);
    assert_eq!(settings.widths, [64, 128]);
    assert_eq!(settings.matrix, [vec![1.0, 2.0], vec![]]);
    let sine = SineSettings { swing_amplitude_rad: 0.4, phase_offsets: vec![0.0, 0.5] };
    assert_eq!(settings.prior, PriorSettings::Sine(sine));
    assert_eq!(settings.legs[0].mount, None);
    assert_eq!(settings.legs[1].link_lengths_m, [0.09, 0.16]);
    assert_eq!(settings.legs[1].mount, Some(MountSettings { position_m: 1e-7 }));
}

#[test]
fn each_problem_says_where_what_and_what_was_expected() {
    let cases = [
        (("gamma = 0.99", "gamma = 1.5"), "doggo.toml:1:9: gamma = 1.5 is out of range: expected a number from 0 to 1"),
        (("gamma = 0.99", "gamma = nan"), "doggo.toml:1:9: gamma = nan is not finite: expected a number from 0 to 1"),
        (
            ("learning_rate = 1", "learning_rate = 1e39"),
            "doggo.toml:6:17: learning_rate = 1e39 is not finite: expected a number above 0",
        ),
        (
            ("learning_rate = 1", "learning_rate = 0"),
            "doggo.toml:6:17: learning_rate = 0 is out of range: expected a number above 0",
        ),
        (
            ("gamma = 0.99", "gamma = \"0.99\""),
            "doggo.toml:1:9: gamma = \"0.99\" has the wrong type: expected a number from 0 to 1",
        ),
        (
            ("num_epochs = 5", "num_epochs = 5.0"),
            "doggo.toml:2:14: num_epochs = 5.0 has the wrong type: expected an integer from 1 to 100",
        ),
        (("num_epochs = 5\n", ""), "doggo.toml:1:1: num_epochs is missing: expected an integer from 1 to 100"),
        (
            ("seed = 18446744073709551615", "seed = -1"),
            "doggo.toml:3:8: seed = -1 is out of range: expected an integer from 0 to 18446744073709551615",
        ),
        (
            ("offset = -3", "offset = 10"),
            "doggo.toml:4:10: offset = 10 is out of range: expected an integer at least -9223372036854775808 and below 10",
        ),
        (
            ("is_adaptive = true", "is_adaptive = 2020-01-01"),
            "doggo.toml:7:15: is_adaptive = 2020-01-01 has the wrong type: expected a boolean",
        ),
        (
            ("[64, 128]", "[64, 0]"),
            "doggo.toml:10:15: widths[1] = 0 is out of range: expected an integer from 1 to 1024",
        ),
        (
            ("[64, 128]", "64"),
            "doggo.toml:10:10: widths = 64 has the wrong type: expected an array of integers from 1 to 1024",
        ),
        (
            ("matrix = [[1.0, 2], []]", "matrix = [[1.0], 2]"),
            "doggo.toml:11:18: matrix[1] = 2 has the wrong type: expected an array of numbers",
        ),
        (
            ("footfall = \"trot\"", "footfall = \"trott\""),
            "doggo.toml:9:12: footfall = \"trott\" is not a known choice: \
             expected one of \"trot\", \"bound\"; did you mean \"trot\"?",
        ),
        (
            ("footfall = \"trot\"", "footfall = \"walk\""),
            "doggo.toml:9:12: footfall = \"walk\" is not a known choice: expected one of \"trot\", \"bound\"",
        ),
        (
            ("footfall = \"trot\"", "footfall = 1"),
            "doggo.toml:9:12: footfall = 1 has the wrong type: expected one of \"trot\", \"bound\"",
        ),
        (
            ("num_epochs = 5", "num_epochs = 5\nclip_epsilom = 0.2"),
            "doggo.toml:3:1: clip_epsilom = 0.2 is not a known key: did you mean \"clip_epsilon\"?",
        ),
        (
            ("[prior]", "[prior]\n\"x.y\" = {}"),
            "doggo.toml:14:1: prior.\"x.y\" = (a table) is not a known key: \
             the keys here are \"swing_amplitude_rad\", \"phase_offsets\"",
        ),
        (("kind = \"sine\"\n", ""), "doggo.toml:13:1: prior.kind is missing: expected one of \"sine\", \"table\""),
        (
            ("kind = \"sine\"", "kind = \"sinus\""),
            "doggo.toml:14:8: prior.kind = \"sinus\" is not a known choice: \
             expected one of \"sine\", \"table\"; did you mean \"sine\"?",
        ),
        (("foot = \"FR\"\n", ""), "doggo.toml:22:1: legs[1].foot is missing: expected a string"),
        (
            ("mount.position_m = 1e-7", "mount = 3"),
            "doggo.toml:25:9: legs[1].mount = 3 has the wrong type: expected a table",
        ),
        (
            ("gamma = 0.99", "gamma = "),
            "doggo.toml:1:9: not valid TOML: string values must be quoted, expected literal string",
        ),
        (("gamma = 0.99", "gamma = 0.99\ngamma = 1"), "doggo.toml:2:1: not valid TOML: duplicate key"),
        (
            ("seed = 18446744073709551615", "seed = 999999999999999999999999999999999999999999"),
            "doggo.toml:3:8: seed is too long: expected an integer of 64 bits",
        ),
    ];
    for (replacement, expected) in cases {
        assert_eq!(report(&[replacement]), expected);
    }
}

#[test]
fn all_problems_are_reported_at_once_sorted_by_position() {
    let report = report(&[
        ("link_lengths_m = [0.09, 0.16]", "link_lengths_m = [0.0, \"x\"]"),
        ("label =", "lable ="),
        ("gamma = 0.99", "gamma = -1"),
    ]);
    assert_eq!(
        report,
        "doggo.toml:1:1: label is missing: expected a string\n\
         doggo.toml:1:9: gamma = -1 is out of range: expected a number from 0 to 1\n\
         doggo.toml:8:1: lable = \"a \\\"b\\\" \\u007F ü\" is not a known key: did you mean \"label\"?\n\
         doggo.toml:20:19: legs[0].link_lengths_m[0] = 0.0 is out of range: expected a number above 0\n\
         doggo.toml:20:24: legs[0].link_lengths_m[1] = \"x\" has the wrong type: expected a number above 0\n\
         5 problems"
    );
}

#[test]
fn problems_beyond_fifty_are_left_out() {
    let text = VALID.replace("[64, 128]", &format!("{:?}", vec![0; 60]));
    let report = read(&text).unwrap_err().to_string();
    assert!(
        report.ends_with("widths[49] = 0 is out of range: expected an integer from 1 to 1024\nmore than 50 problems")
    );
}

#[test]
fn columns_count_characters() {
    let report = report(&[("foot = \"FL\"", "\"füß\" = 1")]);
    assert!(report.contains("doggo.toml:19:1: legs[0].\"füß\" = 1 is not a known key"));
    let report = self::report(&[("[64, 128]", "[\"ü\", 1]")]);
    assert!(report.starts_with("doggo.toml:10:11: widths[0] = \"ü\""));
    let report = self::report(&[("[[1.0, 2], []]", "[\"ü\", 1]")]);
    assert!(report.contains("doggo.toml:11:16: matrix[1] = 1"));
}

#[test]
fn semantic_problems_have_the_position_of_their_key() {
    let document = Document::parse("doggo.toml", VALID.as_bytes()).unwrap();
    let problems = document
        .read_checked(|settings: &AllSettings, problems| {
            problems.at("legs[1].foot", format!("expected {} feet", settings.legs.len()));
            problems.at("prior.frequency_hz", "needed with a sine");
            problems.at("widths", "expected three layers");
        })
        .unwrap_err();
    assert_eq!(
        problems.to_string(),
        "doggo.toml:10:10: widths = (an array) is refused: expected three layers\n\
         doggo.toml:13:1: prior.frequency_hz is refused: needed with a sine\n\
         doggo.toml:23:8: legs[1].foot = \"FR\" is refused: expected 2 feet\n\
         3 problems"
    );
    let mut later = document.problems();
    assert!(later.is_empty());
    later.at("", "does not fit the model");
    assert_eq!(later.finish(()).unwrap_err().to_string(), "doggo.toml:1:1: is refused: does not fit the model");
}

#[test]
fn whole_file_problems_have_no_line() {
    let parse = |bytes: &[u8]| Document::parse("x.toml", bytes).unwrap_err().to_string();
    assert_eq!(parse(b"a = \"\xff\""), "x.toml: not UTF-8: the byte at offset 5 belongs to no character");
    assert_eq!(parse(&vec![b'\n'; (1 << 20) + 1]), "x.toml: file too large: expected at most 1048576 bytes");
    assert!(Document::parse("x.toml", &vec![b'\n'; 1 << 20]).is_ok());

    let missing = Document::load("/nowhere/x.toml".as_ref()).unwrap_err();
    assert_eq!(missing.iter().next().unwrap().kind, ProblemKind::Unreadable);
    assert!(missing.to_string().starts_with("/nowhere/x.toml: cannot be read: "));
}

#[test]
fn strings_and_keys_have_a_longest_length() {
    let parse = |text: String| Document::parse("x.toml", text.as_bytes());
    assert!(parse(format!("a = '{}'", "ü".repeat(4096))).is_ok());
    assert_eq!(
        parse(format!("[a]\nb = '{}'", "x".repeat(4097))).unwrap_err().to_string(),
        "x.toml:2:5: a.b is too long: expected at most 4096 characters"
    );
    assert_eq!(
        parse(format!("[a]\n{} = 1", "x".repeat(4097))).unwrap_err().to_string(),
        "x.toml:2:1: a is too long: expected keys of at most 4096 characters"
    );
    let long_value = report(&[("gamma = 0.99", &format!("gamma = '{}'", "x".repeat(100)))]);
    assert!(long_value.contains(&format!("gamma = '{}... has", "x".repeat(59))));
}
