//! The paper's Table 5: the animal by its parts, each cut into sections.

use serde::Serialize;

use super::study::{Study, Subject, Way, section_mm, values_by_key};
use crate::evaluate::sections_of;
use crate::shape::animal::{Part, nearest_part};

/// One section of a part.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    pub(super) part: Part,
    /// Number of the section within the part, from 1.
    pub(super) section: usize,
    /// Mean smallest distance of each way, mm, both directions alike; none where the plane misses the
    /// part in either mesh.
    #[serde(serialize_with = "values_by_key")]
    pub(super) mean_mm: Vec<(Way, Option<f64>)>,
}

/// The rows of all parts.
pub(super) fn rows(subject: &Subject, study: &Study) -> Vec<Row> {
    let part_of = nearest_part();
    let mut rows = Vec::new();
    for part in Part::ALL {
        let of = |way: Way| {
            let mesh = &study.found(way)?.mesh;
            let belongs = |point: &_| part_of(point) == part;
            Some(sections_of(mesh, &subject.truth, &part.axis(), part.sections(), &belongs))
        };
        let columns = Way::ALL.map(|way| (way, of(way)));
        rows.extend((0..part.sections()).map(|i| {
            Row {
                part,
                section: i + 1,
                mean_mm: columns
                    .iter()
                    .map(|(way, sections)| (*way, sections.as_ref().and_then(|s| section_mm(&s[i]))))
                    .collect(),
            }
        }));
    }
    rows
}
