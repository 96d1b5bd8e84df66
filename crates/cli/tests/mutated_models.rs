//! Doggo's model, damaged at random: canter takes it or refuses it in words, and never panics, crashes or hangs.
//!
//! `CANTER_MUTATED_MODELS=10000` tries more of them; the first ones stay the same.
#![cfg(unix)]

mod common;

use std::fs;
use std::ops::Range;
use std::sync::Mutex;
use std::time::Instant;

use common::{TemporaryFolder, for_each, in_repository};
use roxmltree::{Document, Node};

/// Models that are tried if nothing else is said.
const NUM_MODELS: usize = 200;

/// How long canter may take for a model before the test calls it stuck [s]: more than its own limit for compiling.
const STUCK_AFTER_S: u64 = 40;

/// What attributes get instead of their values.
const VALUES: [&str; 12] =
    ["0", "-1", "1e9", "-1e9", "1e300", "1e-300", "nan", "inf", "-inf", "", "0 0 0 0 0 0 0 0 0 0", "true"];

/// Characters of a very long value.
const LONG: usize = 100_000;

/// SplitMix64, Steele et al. 2014.
struct Random(u64);

impl Random {
    /// A number below `end`.
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % end as u64) as usize
    }

    fn one<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }
}

/// The model with one to three kinds of damage, mostly one: more is seldom compiled.
fn mutate(model: &str, number: usize) -> Vec<u8> {
    let mut random = Random(number as u64);
    let mut text = model.to_owned();
    for _ in 0..*random.one(&[1, 1, 1, 2, 3]) {
        if elements(&text).is_empty() {
            break;
        }
        text = match random.below(5) {
            0 => with_other_value(&text, &mut random),
            1 => with_other_attribute(&text, &mut random),
            2 => without_element(&text, &mut random),
            3 => with_element_twice(&text, &mut random),
            _ => with_elements_swapped(&text, &mut random),
        };
    }
    let mut bytes = text.into_bytes();
    if random.below(6) == 0 {
        for _ in 0..=random.below(3) {
            let place = random.below(bytes.len());
            // Few bytes beyond ASCII: almost none of them make UTF-8.
            bytes[place] = random.below(130) as u8;
        }
    }
    bytes
}

/// A part of the model: the name of an element or attribute, and where the element or the attribute's value stands.
type Part = (String, Range<usize>);

/// All elements but the root.
fn elements(text: &str) -> Vec<Part> {
    let document = Document::parse(text).unwrap();
    let elements = document.root_element().descendants().skip(1).filter(Node::is_element);
    elements.map(|node| (node.tag_name().name().to_owned(), node.range())).collect()
}

/// The values of all attributes.
fn values(text: &str) -> Vec<Part> {
    let document = Document::parse(text).unwrap();
    let attributes = document.descendants().flat_map(|node| node.attributes());
    attributes.map(|attribute| (attribute.name().to_owned(), attribute.range_value())).collect()
}

/// Two parts, mostly of the same name; more of what they make is compiled.
fn two(parts: &[Part], random: &mut Random) -> [Range<usize>; 2] {
    let (name, first) = random.one(parts);
    let alike: Vec<_> = parts.iter().filter(|(other, _)| other == name).cloned().collect();
    let others = if random.below(4) == 0 { parts } else { &alike };
    let (_, second) = random.one(others);
    [first.clone(), second.clone()]
}

fn replaced(text: &str, range: Range<usize>, with: &str) -> String {
    [&text[..range.start], with, &text[range.end..]].concat()
}

fn with_other_value(text: &str, random: &mut Random) -> String {
    let (_, range) = random.one(&values(text)).clone();
    if random.below(20) == 0 {
        let unit = *random.one::<&str>(&["x", "1 ", "9"]);
        return replaced(text, range, &unit.repeat(LONG / unit.len()));
    }
    replaced(text, range, random.one::<&str>(&VALUES))
}

fn with_other_attribute(text: &str, random: &mut Random) -> String {
    let [range, other] = two(&values(text), random);
    replaced(text, range, &text[other])
}

fn without_element(text: &str, random: &mut Random) -> String {
    let (_, range) = random.one(&elements(text)).clone();
    replaced(text, range, "")
}

fn with_element_twice(text: &str, random: &mut Random) -> String {
    let [range, other] = two(&elements(text), random);
    replaced(text, other.start..other.start, &text[range])
}

fn with_elements_swapped(text: &str, random: &mut Random) -> String {
    let [mut first, mut second] = two(&elements(text), random);
    if first.start > second.start {
        (first, second) = (second, first);
    }
    // One inside the other stays.
    if first.end > second.start {
        return text.to_owned();
    }
    let [a, between, b] = [first.clone(), first.end..second.start, second.clone()].map(|range| &text[range]);
    replaced(text, first.start..second.end, &[b, between, a].concat())
}

/// What canter said of all models.
#[derive(Default)]
struct Tally {
    num_taken: usize,
    num_refused: usize,
    num_limited: usize,
    slowest: (f64, usize),
}

#[test]
fn damaged_models_are_taken_or_refused_in_words() {
    let number = std::env::var("CANTER_MUTATED_MODELS").map_or(NUM_MODELS, |number| number.parse().unwrap());
    let model = fs::read_to_string(in_repository("robots/doggo/doggo.xml")).unwrap();
    let tally = Mutex::new(Tally::default());
    for_each(&(0..number).collect::<Vec<_>>(), |&number| {
        let folder = TemporaryFolder::new();
        fs::copy(in_repository("robots/doggo/robot.toml"), folder.join("robot.toml")).unwrap();
        fs::write(folder.join("doggo.xml"), mutate(&model, number)).unwrap();
        let begin = Instant::now();
        let Some(finished) = folder.canter_within(&["robots", "./robot.toml"], STUCK_AFTER_S) else {
            return Err(format!("{number}: stuck"));
        };
        let seconds = begin.elapsed().as_secs_f64();
        let said = &finished.stderr;
        let mut tally = tally.lock().unwrap();
        let is_limited = said.contains("compiling it takes more than") || said.contains("it crashes MuJoCo");
        tally.num_limited += usize::from(is_limited);
        if seconds > tally.slowest.0 && !is_limited {
            tally.slowest = (seconds, number);
        }
        match finished.code {
            _ if said.contains("panicked") => Err(format!("{number}: {said}")),
            Some(0) => {
                tally.num_taken += 1;
                Ok(())
            }
            Some(1) if said.contains("error: ./") => {
                tally.num_refused += 1;
                Ok(())
            }
            code => Err(format!("{number}: code {code:?}: {said}")),
        }
    });
    let Tally { num_taken, num_refused, num_limited, slowest: (seconds, slowest) } = tally.into_inner().unwrap();
    println!("{number} models: {num_taken} taken, {num_refused} refused, {num_limited} of them by the guard's limits");
    println!("the slowest of the others, number {slowest}, took {seconds:.3} s");
    assert!(number < 100 || num_taken > number / 50 && num_refused > number / 50, "{num_taken} and {num_refused}");
}
