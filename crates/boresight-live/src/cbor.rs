//! JSON objects as CBOR (RFC 8949): the same fields in fewer bytes, and quicker to read.
//!
//! Each number has its shortest form that is the same number; keys stand in the order of the text. The text is there already, and is read once more only where CBOR is asked for.

use serde_json::Value;
use std::borrow::Cow;

/// The CBOR of a JSON text; `None` if it is none.
pub fn of_json(json: &str) -> Option<Vec<u8>> {
    let value: Value = serde_json::from_str(json).ok()?;
    let mut out = Vec::with_capacity(json.len());
    ciborium::into_writer(&value, &mut out).ok()?;
    Some(out)
}

/// How an event is written on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// As JSON.
    #[default]
    Json,
    /// As CBOR.
    Cbor,
}

impl Form {
    /// The bytes of a JSON text in this form.
    pub fn bytes(self, json: &str) -> Cow<'_, [u8]> {
        match self {
            Self::Cbor => of_json(json).unwrap_or_default().into(),
            Self::Json => json.as_bytes().into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_examples_of_the_standard() {
        // RFC 8949, appendix A, those that JSON can say.
        for (json, hex) in [
            ("0", "00"),
            ("23", "17"),
            ("24", "1818"),
            ("100", "1864"),
            ("1000", "1903e8"),
            ("1000000", "1a000f4240"),
            ("1000000000000", "1b000000e8d4a51000"),
            ("18446744073709551615", "1bffffffffffffffff"),
            ("-1", "20"),
            ("-10", "29"),
            ("-100", "3863"),
            ("-1000", "3903e7"),
            ("1.1", "fb3ff199999999999a"),
            ("100000.0", "fa47c35000"),
            ("3.4028234663852886e+38", "fa7f7fffff"),
            ("1.0e+300", "fb7e37e43c8800759c"),
            ("-4.1", "fbc010666666666666"),
            ("false", "f4"),
            ("true", "f5"),
            ("null", "f6"),
            ("\"\"", "60"),
            ("\"IETF\"", "6449455446"),
            ("\"\\\"\\\\\"", "62225c"),
            ("\"\u{fc}\"", "62c3bc"),
            ("[]", "80"),
            ("[1,[2,3],[4,5]]", "8301820203820405"),
            ("{}", "a0"),
            ("{\"a\":1,\"b\":[2,3]}", "a26161016162820203"),
        ] {
            let bytes: String = of_json(json).unwrap().iter().map(|b| format!("{b:02x}")).collect();
            assert_eq!(bytes, hex, "{json}");
        }
        assert_eq!(of_json("{"), None);
    }
}
