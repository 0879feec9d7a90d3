//! The paper's section 5 on built-in shapes: its tables, its plot and its pictures, with simpler methods
//! beside.
//!
//! In: how much effort. Out: a folder with `experiments.md`, `experiments.json`, a folder a shape with all
//! that a reconstruction leaves ([`crate::output`]), and `figures/*.png`. Everything is made in a temporary
//! folder inside the target and moved only when all of it is complete.

mod branches;
mod figures;
mod page;
mod parts;
mod study;

use rayon::prelude::*;
use serde::Serialize;
use std::io;
use std::path::Path;

use crate::export::ExportError;
use crate::reconstruct::Front;
use crate::shape::Shape;
use crate::unfinished;
use branches::Point;
use parts::Row;
pub use study::{Study, Way};
use study::{Subject, study};

/// How finely to work.
#[derive(Clone, Debug)]
pub struct Effort {
    /// Shapes, in the order of the table.
    pub shapes: Vec<Shape>,
    /// Cell of the true meshes, times the shapes' own.
    pub truth: f64,
    /// Grid spacing of the models, mm, if not their own.
    pub cell: Option<f64>,
    /// Grid spacing of the two baselines, mm.
    pub baseline_cell: f64,
    /// Points on each surface from which errors are measured.
    pub samples: usize,
    /// Skeletons of the animal with this many branches.
    pub branches: Vec<u16>,
    /// Where the visible side of the default's models comes from.
    pub front: Front,
}

impl Effort {
    /// As the tables are meant.
    #[must_use]
    pub fn full() -> Self {
        Self {
            shapes: Shape::ALL.to_vec(),
            truth: 1.0,
            cell: None,
            baseline_cell: 2.5,
            samples: 5_000,
            branches: (1..=16).collect(),
            front: Front::default(),
        }
    }

    /// Coarse, and only what the figures need.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            shapes: vec![Shape::Torus, Shape::Animal],
            truth: 1.7,
            cell: Some(4.0),
            baseline_cell: 6.0,
            samples: 1_000,
            branches: vec![1, 4, 8, 14],
            front: Front::default(),
        }
    }

    /// Steps that [`run`] reports.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.shapes.len() + 1 + self.branches.len()
    }
}

/// All that was found.
#[derive(Debug, Serialize)]
pub struct Experiments {
    /// Where the visible side of the default's models comes from.
    front: Front,
    /// Every shape, and at last the torus again, in noise.
    pub shapes: Vec<Study>,
    /// The animal by parts.
    parts: Vec<Row>,
    /// The animal by number of branches.
    branches: Vec<Point>,
}

/// Why there are no results.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// A file could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// A file could not be written or moved.
    #[error("cannot write the experiments into {path}")]
    Folder {
        /// The folder of the results.
        path: String,
        /// What the system says.
        source: io::Error,
    },
    /// The figures cannot be told.
    #[error("cannot write the figures as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Does all experiments and writes them into `folder`; calls `step` after each of [`Effort::steps`].
///
/// # Errors
///
/// If a file cannot be written: then the folder is as it was.
pub fn run(folder: &Path, effort: &Effort, step: &(dyn Fn() + Sync)) -> Result<Experiments, ExperimentError> {
    let in_folder = |source| ExperimentError::Folder { path: folder.display().to_string(), source };
    let existed = folder.exists();
    std::fs::create_dir_all(folder).map_err(in_folder)?;
    let made = unfinished::Folder::within(folder).map_err(in_folder).and_then(|staged| {
        let found = fill(staged.path(), effort, step)?;
        publish(staged.path(), folder).map_err(in_folder)?;
        Ok(found)
    });
    if made.is_err() && !existed {
        // What still holds files stays: then it is no longer ours alone.
        let _ = std::fs::remove_dir(folder);
    }
    made
}

/// Makes every file in a folder of its own.
fn fill(folder: &Path, effort: &Effort, step: &(dyn Fn() + Sync)) -> Result<Experiments, ExperimentError> {
    let in_folder = |source| ExperimentError::Folder { path: folder.display().to_string(), source };
    let mut subjects: Vec<Subject> =
        effort.shapes.par_iter().map(|shape| Subject::new(*shape, effort)).collect();
    subjects.push(Subject::noisy(Shape::Torus, effort));
    let studied = subjects.par_iter().map(|subject| {
        let study = study(subject, effort, &folder.join(&subject.name));
        step();
        study
    });
    let shapes = studied.collect::<Result<Vec<_>, _>>()?;
    let figures = folder.join("figures");
    std::fs::create_dir(&figures).map_err(in_folder)?;
    let all: Vec<(&Subject, &Study)> = subjects.iter().zip(&shapes).collect();
    for (subject, study) in &all {
        figures::beside_baselines(&figures, subject, study).map_err(in_folder)?;
    }
    if let Some((subject, study)) = all.last() {
        figures::noise(&figures, subject, study).map_err(in_folder)?;
    }
    let animal = all.iter().find(|(subject, _)| subject.shape == Shape::Animal);
    let (mut parts, mut branches) = (Vec::new(), Vec::new());
    if let Some((subject, study)) = animal {
        parts = parts::rows(subject, study);
        let grown = branches::grow(subject, effort, step);
        figures::branches(&figures, subject, &grown).map_err(in_folder)?;
        branches = grown.into_iter().map(|(point, _)| point).collect();
    }
    let found = Experiments { front: effort.front, shapes, parts, branches };
    let json = serde_json::to_vec_pretty(&found)?;
    std::fs::write(folder.join("experiments.json"), json).map_err(in_folder)?;
    std::fs::write(folder.join("experiments.md"), page::page(&found)).map_err(in_folder)?;
    Ok(found)
}

/// Moves what was made to its place, instead of what an earlier run left there under the same names.
fn publish(staged: &Path, folder: &Path) -> io::Result<()> {
    for entry in std::fs::read_dir(staged)? {
        let entry = entry?;
        let place = folder.join(entry.file_name());
        if place.is_dir() {
            std::fs::remove_dir_all(&place)?;
        }
        std::fs::rename(entry.path(), place)?;
    }
    Ok(())
}
