//! Names in a fleet: `ossature/SITE/BOARD/WHAT`.
//!
//! Site and board are chosen by whoever publishes: letters, digits, `-`, `_` and `.`, not first. They become folders
//! at the other end, so nothing else is taken from the network either.

use std::fmt;
use std::str::FromStr;

/// With what every name begins.
const ROOT: &str = "ossature";
/// Longest name of a site or a board, bytes.
const MOST: usize = 64;

/// A board, or with a `*` for its site or its name, several.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Board {
    site: String,
    name: String,
}

impl Board {
    /// The site's name.
    #[must_use]
    pub fn site(&self) -> &str {
        &self.site
    }

    /// The board's own.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is one board.
    #[must_use]
    pub fn is_one(&self) -> bool {
        self.site != "*" && self.name != "*"
    }

    /// One board, which publishes.
    ///
    /// # Errors
    /// What a name must look like.
    pub fn one(text: &str) -> Result<Self, String> {
        let board: Self = text.parse()?;
        if board.is_one() { Ok(board) } else { Err("name one board: a * is for those who look on".into()) }
    }

    /// The board and what is sent, in a key of the network; None if it is none of ours.
    #[must_use]
    pub fn of_message(key: &str) -> Option<(Self, Leaf)> {
        let (board, leaf) = key.rsplit_once('/')?;
        Some((Self::one(board).ok()?, Leaf::ALL.into_iter().find(|known| known.name() == leaf)?))
    }

    /// The key of what it sends.
    #[must_use]
    pub fn key(&self, leaf: Leaf) -> String {
        format!("{self}/{}", leaf.name())
    }

    /// The key at which it takes orders: `threshold`, `polarity`, `region`, `exposure`, `pairs`.
    #[must_use]
    pub fn order(&self, what: &str) -> String {
        format!("{self}/do/{what}")
    }
}

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{ROOT}/{}/{}", self.site, self.name)
    }
}

impl FromStr for Board {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let is_name = |part: &str| {
            (1..=MOST).contains(&part.len()) && part.chars().all(is_plain) && !part.starts_with('.')
        };
        let parts: Vec<&str> = text.split('/').collect();
        match parts[..] {
            [ROOT, site, name] if [site, name].iter().all(|part| *part == "*" || is_name(part)) => {
                Ok(Self { site: site.to_owned(), name: name.to_owned() })
            }
            _ => Err(format!(
                "must be {ROOT}/SITE/BOARD, names of up to {MOST} letters, digits, -, _ and . (not first)"
            )),
        }
    }
}

/// What a board sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Leaf {
    /// What the pixels of its shapes mean: the frame that uploads a calibration (docs/wire-format.md).
    Calibration,
    /// A pair as a device describes it: the frame of a pair (docs/wire-format.md).
    Shape,
    /// The solid's surface: `model.ply`.
    Model,
    /// What became of a pair: JSON, as `host listen --json` prints it.
    Pair,
    /// How a device fares: JSON, as in `host device info --json`.
    Health,
    /// How its pairs fare: JSON.
    Status,
}

impl Leaf {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Calibration, Self::Shape, Self::Model, Self::Pair, Self::Health, Self::Status];

    /// The last part of its keys.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Calibration => "calibration",
            Self::Shape => "shape",
            Self::Model => "model",
            Self::Pair => "pair",
            Self::Health => "health",
            Self::Status => "status",
        }
    }

    /// What kind of bytes these are, as a media type.
    #[must_use]
    pub const fn media(self) -> &'static str {
        match self {
            Self::Calibration | Self::Shape => "application/octet-stream",
            Self::Model => "model/x-ply",
            Self::Pair | Self::Health | Self::Status => "application/json",
        }
    }

    /// Longest that it may be, bytes.
    #[must_use]
    pub const fn most(self) -> usize {
        match self {
            Self::Model => 16 << 20,
            _ => 64 << 10,
        }
    }

    /// Whether the last one can be asked for by those who come late.
    #[must_use]
    pub const fn is_kept(self) -> bool {
        matches!(self, Self::Calibration | Self::Health | Self::Status)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_folders() {
        let board = Board::one("ossature/lab-1/left.2").unwrap();
        assert_eq!((board.site(), board.name()), ("lab-1", "left.2"));
        assert_eq!(board.key(Leaf::Model), "ossature/lab-1/left.2/model");
        assert_eq!(board.order("threshold"), "ossature/lab-1/left.2/do/threshold");
        for leaf in Leaf::ALL {
            assert_eq!(Board::of_message(&board.key(leaf)), Some((board.clone(), leaf)));
        }
        let several: Board = "ossature/*/left".parse().unwrap();
        assert!(!several.is_one() && Board::one("ossature/*/left").is_err());
        let long = format!("ossature/lab/{}", "x".repeat(65));
        for text in
            ["", "lab/left", "ossature/lab", "ossature/../left", "ossature/lab/.", "ossature/lab/a b", &long]
        {
            assert!(text.parse::<Board>().is_err(), "{text}");
        }
        for key in ["ossature/lab/left/other", "ossature/*/left/model", "ossature/lab/left/do/model", "model"]
        {
            assert_eq!(Board::of_message(key), None, "{key}");
        }
    }
}
