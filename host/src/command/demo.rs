//! Stub.
/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {}
/// Runs.
/// # Errors
/// Never.
pub fn run(_: &Args) -> Result<(), super::Failure> {
    Ok(())
}
