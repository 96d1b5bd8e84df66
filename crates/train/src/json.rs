//! What our JSON files have in common.

use serde_json::Value;

/// Numbers of our files stay far below it; beyond it sums and squares of them are not finite.
pub(crate) const LARGEST: f64 = 1e30;

/// The largest magnitude of all numbers in a JSON value; 0 if it has none.
pub(crate) fn largest_number(value: &Value) -> f64 {
    match value {
        // A number that is no f64 cannot be read as one of our fields either.
        Value::Number(number) => number.as_f64().map_or(f64::INFINITY, f64::abs),
        Value::Array(values) => values.iter().map(largest_number).fold(0.0, f64::max),
        Value::Object(entries) => entries.values().map(largest_number).fold(0.0, f64::max),
        Value::Null | Value::Bool(_) | Value::String(_) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn numbers_are_found_wherever_they_stand() {
        assert_eq!(largest_number(&json!({ "a": [1, { "b": -7.5 }], "c": "99", "d": null })), 7.5);
        assert_eq!(largest_number(&json!("99")), 0.0);
    }
}
