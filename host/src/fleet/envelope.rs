//! What goes with every message: JSON in its attachment, so that any client can read it.
//!
//! ```json
//! {"contract":1,"run":"63f1a2b3c4d5e","number":17,"pair":18,"time_us":1767225600000000}
//! ```

use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The version of names, envelopes and bytes. Fields may be added to it; what changes otherwise has another.
pub const CONTRACT: u32 = 1;
/// Longest name of a run, bytes.
const MOST_RUN: usize = 32;

/// A message's place among others.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Envelope {
    /// [`CONTRACT`].
    pub contract: u32,
    /// Which run of the publisher: letters and digits. Numbers begin anew with it.
    pub run: String,
    /// Messages of this run under this key before it.
    pub number: u64,
    /// The pair of this run that it is about, from 1, or 0.
    pub pair: u64,
    /// When it was sent, microseconds of Unix time by the publisher's clock.
    pub time_us: u64,
    /// How long ago it was sent, if it was asked for later, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub age_ms: Option<u64>,
}

impl Envelope {
    /// As an attachment.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        // Plain data becomes JSON; were it not to, the other end would say that it cannot read it.
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// What an attachment says.
    ///
    /// # Errors
    /// Why it is none.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        // The contract first: another may have other fields.
        let fields: Value = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        match fields["contract"].as_u64() {
            Some(contract) if contract == u64::from(CONTRACT) => {}
            Some(other) => {
                return Err(format!(
                    "it is of contract {other}, this program's is {CONTRACT}; bring both to the same release"
                ));
            }
            None => return Err("it names no contract".into()),
        }
        let envelope: Self = serde_json::from_value(fields).map_err(|error| error.to_string())?;
        let is_run = (1..=MOST_RUN).contains(&envelope.run.len())
            && envelope.run.bytes().all(|byte| byte.is_ascii_alphanumeric());
        if is_run { Ok(envelope) } else { Err(format!("a run is 1 to {MOST_RUN} letters and digits")) }
    }
}

/// Microseconds of Unix time.
#[must_use]
pub fn now_us() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_micros()).unwrap_or(u64::MAX)
}

/// A new run.
#[must_use]
pub fn new_run() -> String {
    format!("{:014x}", now_us())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::damaged::damaged;
    use crate::random::Random;

    #[test]
    fn an_envelope_is_read_as_it_was_written_and_others_are_refused() {
        let envelope = Envelope {
            contract: CONTRACT,
            run: "0a1".into(),
            number: 17,
            pair: 18,
            time_us: 5,
            age_ms: None,
        };
        let bytes = envelope.to_bytes();
        assert_eq!(bytes, br#"{"contract":1,"run":"0a1","number":17,"pair":18,"time_us":5}"#);
        assert_eq!(Envelope::from_bytes(&bytes), Ok(envelope));
        for (text, words) in [
            ("", "EOF"),
            (r#"{"contract":2}"#, "contract 2"),
            (r#"{"run":"0"}"#, "no contract"),
            (r#"{"contract":1,"run":"../x","number":1,"pair":0,"time_us":0}"#, "letters and digits"),
            (r#"{"contract":1,"run":"","number":1,"pair":0,"time_us":0}"#, "letters and digits"),
            (r#"{"contract":1,"run":"0","number":-1,"pair":0,"time_us":0}"#, "-1"),
        ] {
            let error = Envelope::from_bytes(text.as_bytes()).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn whatever_is_attached_is_refused_or_read_as_an_envelope_of_this_contract() {
        let sound = br#"{"contract":1,"run":"0a1","number":17,"pair":18,"time_us":5,"age_ms":3}"#;
        let (mut random, mut read) = (Random::new(1), 0);
        for _ in 0..20_000 {
            match Envelope::from_bytes(&damaged(sound, &mut random)) {
                Err(error) => assert_eq!(error.lines().count(), 1, "{error}"),
                Ok(envelope) => {
                    assert_eq!(envelope.contract, CONTRACT);
                    assert!(
                        !envelope.run.is_empty() && envelope.run.chars().all(|c| c.is_ascii_alphanumeric())
                    );
                    assert_eq!(Envelope::from_bytes(&envelope.to_bytes()), Ok(envelope));
                    read += 1;
                }
            }
        }
        assert!((500..19_500).contains(&read), "{read} of 20000 are still envelopes");
    }

    #[test]
    fn a_run_has_a_name_of_its_own() {
        let first = new_run();
        std::thread::sleep(std::time::Duration::from_millis(2));
        assert!(first != new_run() && first.len() == 14);
    }
}
