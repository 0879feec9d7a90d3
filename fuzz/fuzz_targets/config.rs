//! Any text as a configuration: what is read knows where it stands, and what is refused says so in a line.
#![no_main]

use host::config::{Config, Place};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    match Config::parse(Path::new("ossature.toml"), text) {
        Ok(config) => {
            let stands = |place: &Place| place.line <= 1 + text.matches('\n').count() && place.column >= 1;
            for table in &config.tables {
                assert!(stands(&table.place));
                assert!(table.entries.iter().all(|entry| stands(&entry.place) && stands(&entry.value_place)));
            }
        }
        Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
    }
});
