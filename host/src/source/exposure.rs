//! How pictures are taken, for sources that can be told: cameras that Linux knows, and devices.

/// For how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exposure {
    /// As the camera finds best.
    Auto,
    /// For so long, in the camera's unit.
    Fixed(u32),
}

/// Times for which a camera can expose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Range {
    /// The shortest.
    pub least: u32,
    /// The longest.
    pub most: u32,
    /// What they are counted in.
    pub unit: &'static str,
    /// Whether it can find one by itself.
    pub auto: bool,
}
