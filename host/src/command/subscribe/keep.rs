//! What comes from boards as files, each whole or not there.
//!
//! ```text
//! DIR/SITE/BOARD/RUN/calibration.bin, health.json, status.json      the last of each
//! DIR/SITE/BOARD/RUN/000001/shape.bin, model.ply, pair.json         of each pair
//! ```

use std::fs;
use std::io::Write;
use std::path::Path;

use crate::export::{ExportError, write_whole};
use crate::fleet::Message;
use crate::fleet::key::Leaf;

/// Keeps a message.
pub(super) fn keep(out: &Path, message: &Message) -> Result<(), ExportError> {
    let Message { board, leaf, envelope, bytes } = message;
    let run = out.join(board.site()).join(board.name()).join(&envelope.run);
    let (folder, name) = match leaf {
        Leaf::Calibration => (run, "calibration.bin"),
        Leaf::Health => (run, "health.json"),
        Leaf::Status => (run, "status.json"),
        Leaf::Shape => (of_pair(&run, envelope.pair), "shape.bin"),
        Leaf::Model => (of_pair(&run, envelope.pair), "model.ply"),
        Leaf::Pair => (of_pair(&run, envelope.pair), "pair.json"),
    };
    fs::create_dir_all(&folder).map_err(|source| ExportError::Io { path: folder.clone(), source })?;
    write_whole(&folder.join(name), |file| file.write_all(bytes))
}

fn of_pair(run: &Path, pair: u64) -> std::path::PathBuf {
    run.join(format!("{pair:06}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fleet::envelope::{CONTRACT, Envelope};
    use crate::fleet::key::Board;

    #[test]
    fn each_pair_has_its_folder_and_each_run() {
        let out = tempfile::tempdir().unwrap();
        let board = Board::one("ossature/lab/left").unwrap();
        for (run, leaf, bytes) in [("a", Leaf::Model, "1"), ("b", Leaf::Model, "2"), ("b", Leaf::Status, "3")]
        {
            let envelope = Envelope {
                contract: CONTRACT,
                run: run.into(),
                number: 0,
                pair: 7,
                time_us: 0,
                age_ms: None,
            };
            keep(out.path(), &Message { board: board.clone(), leaf, envelope, bytes: bytes.into() }).unwrap();
        }
        for (name, bytes) in
            [("a/000007/model.ply", "1"), ("b/000007/model.ply", "2"), ("b/status.json", "3")]
        {
            assert_eq!(fs::read(out.path().join("lab/left").join(name)).unwrap(), bytes.as_bytes());
        }
        assert_eq!(fs::read_dir(out.path().join("lab/left/a/000007")).unwrap().count(), 1);
    }
}
