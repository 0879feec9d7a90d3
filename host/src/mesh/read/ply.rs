//! PLY (G. Turk, "The PLY Polygon File Format", 1994): ascii and binary, either byte order, with any
//! elements and properties around the `x y z`, `radius` and `confidence` of `vertex`, the list of `face` and the ends of
//! `edge`, which are all that is kept.

use std::str::SplitAsciiWhitespace;

use nalgebra::Point3;

use crate::curves::Curves;
use crate::geometry::Geometry;
use crate::mesh::Mesh;

/// The mesh in the bytes of a PLY file, or its curves if it has no element `face`.
///
/// # Errors
///
/// What is wrong.
pub(super) fn parse(bytes: &[u8]) -> Result<Geometry, String> {
    let (header, body) = Header::parse(bytes)?;
    let mut values = match header.format {
        Format::Ascii => {
            let text = str::from_utf8(body).map_err(|_| "its values are not text")?;
            let above = bytes[..bytes.len() - body.len()].iter().filter(|byte| **byte == b'\n').count();
            Values::Ascii { words: text.split_ascii_whitespace(), text, above }
        }
        Format::LittleEndian => Values::Binary { rest: body, little: true },
        Format::BigEndian => Values::Binary { rest: body, little: false },
    };
    let mut kept = Kept::default();
    for element in &header.elements {
        element
            .read(&mut values, &mut kept)
            .map_err(|what| format!("in element {}: {what}", element.name))?;
    }
    let Kept { points, radii, confidence, edges, faces } = kept;
    if header.elements.iter().any(|element| element.name == "face") {
        return Ok(Geometry::Mesh { mesh: Mesh { vertices: points, faces }, confidence });
    }
    Ok(Geometry::Curves(Curves { points, radii, edges }))
}

/// What is kept of the elements.
#[derive(Default)]
struct Kept {
    points: Vec<Point3<f64>>,
    radii: Vec<f64>,
    confidence: Vec<f64>,
    edges: Vec<[u32; 2]>,
    faces: Vec<[u32; 3]>,
}

enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn named(name: Option<&str>) -> Result<Self, String> {
        Ok(match name {
            Some("char" | "int8") => Self::I8,
            Some("uchar" | "uint8") => Self::U8,
            Some("short" | "int16") => Self::I16,
            Some("ushort" | "uint16") => Self::U16,
            Some("int" | "int32") => Self::I32,
            Some("uint" | "uint32") => Self::U32,
            Some("float" | "float32") => Self::F32,
            Some("double" | "float64") => Self::F64,
            other => return Err(format!("the header has a property of unknown type {other:?}")),
        })
    }
}

struct Property {
    name: String,
    kind: Kind,
    /// Of a list, the type of its length.
    length: Option<Kind>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    format: Format,
    elements: Vec<Element>,
}

impl Header {
    /// The header, and the bytes behind it.
    fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), String> {
        let mut rest = bytes;
        if next_line(&mut rest)? != "ply" {
            return Err("it does not begin with \"ply\"".into());
        }
        let mut format = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let line = next_line(&mut rest)?;
            let mut words = line.split_ascii_whitespace();
            match words.next() {
                Some("format") => format = Some(parse_format(words.next())?),
                Some("element") => elements.push(parse_element(words)?),
                Some("property") => {
                    let element = elements.last_mut().ok_or("a property stands before any element")?;
                    element.properties.push(parse_property(words)?);
                }
                Some("end_header") => break,
                Some("comment" | "obj_info") | None => {}
                Some(other) => return Err(format!("the header has the unknown line \"{other} ...\"")),
            }
        }
        Ok((Self { format: format.ok_or("the header does not name a format")?, elements }, rest))
    }
}

/// Takes a line off the header, without its end.
fn next_line<'a>(rest: &mut &'a [u8]) -> Result<&'a str, String> {
    let end = rest.iter().position(|&byte| byte == b'\n').ok_or("the header does not end")?;
    let line = str::from_utf8(&rest[..end]).map_err(|_| "the header is not text")?;
    *rest = &rest[end + 1..];
    Ok(line.trim_end())
}

fn parse_format(name: Option<&str>) -> Result<Format, String> {
    match name {
        Some("ascii") => Ok(Format::Ascii),
        Some("binary_little_endian") => Ok(Format::LittleEndian),
        Some("binary_big_endian") => Ok(Format::BigEndian),
        other => Err(format!("the format {other:?} is unknown")),
    }
}

fn parse_element(mut words: SplitAsciiWhitespace) -> Result<Element, String> {
    let name = words.next().ok_or("an element has no name")?;
    let count = words.next().and_then(|count| count.parse().ok());
    let count = count.ok_or_else(|| format!("the number of element {name} is not a number"))?;
    Ok(Element { name: name.into(), count, properties: Vec::new() })
}

fn parse_property(mut words: SplitAsciiWhitespace) -> Result<Property, String> {
    let first = words.next();
    let (length, kind) = if first == Some("list") {
        (Some(Kind::named(words.next())?), Kind::named(words.next())?)
    } else {
        (None, Kind::named(first)?)
    };
    Ok(Property { name: words.next().ok_or("a property has no name")?.into(), kind, length })
}

impl Element {
    /// Reads all its instances and keeps vertices, edges and faces. What is kept grows with what has been read,
    /// not with the count, which may lie.
    fn read(&self, values: &mut Values, kept: &mut Kept) -> Result<(), String> {
        if self.properties.is_empty() {
            return Ok(());
        }
        match self.name.as_str() {
            "vertex" => self.read_vertices(values, kept),
            "edge" => self.read_edges(values, kept),
            "face" => self.read_faces(values, kept),
            _ => (0..self.count).try_for_each(|_| {
                self.properties.iter().try_for_each(|property| property.read(values, |_| {}))
            }),
        }
    }

    /// Where a property of one value stands.
    fn place(&self, name: &str) -> Result<usize, String> {
        let found = self.properties.iter().position(|p| p.name == name && p.length.is_none());
        found.ok_or_else(|| format!("there is no property {name}"))
    }

    fn read_vertices(&self, values: &mut Values, kept: &mut Kept) -> Result<(), String> {
        let axes = [self.place("x")?, self.place("y")?, self.place("z")?];
        let [radius, confidence] = ["radius", "confidence"].map(|name| self.place(name).ok());
        for _ in 0..self.count {
            let mut vertex = Point3::origin();
            for (i, property) in self.properties.iter().enumerate() {
                let axis = axes.iter().position(|&axis| axis == i);
                property.read(values, |value| {
                    if let Some(axis) = axis {
                        vertex[axis] = value;
                    } else if radius == Some(i) {
                        kept.radii.push(value);
                    } else if confidence == Some(i) {
                        kept.confidence.push(value);
                    }
                })?;
            }
            kept.points.push(vertex);
        }
        Ok(())
    }

    fn read_edges(&self, values: &mut Values, kept: &mut Kept) -> Result<(), String> {
        let ends = [self.place("vertex1")?, self.place("vertex2")?];
        for _ in 0..self.count {
            let mut edge = [0; 2];
            for (i, property) in self.properties.iter().enumerate() {
                let mut last = 0.0;
                property.read(values, |value| last = value)?;
                if let Some(end) = ends.iter().position(|&end| end == i) {
                    edge[end] = index(last).ok_or_else(|| format!("an edge has the end {last}"))?;
                }
            }
            kept.edges.push(edge);
        }
        Ok(())
    }

    fn read_faces(&self, values: &mut Values, kept: &mut Kept) -> Result<(), String> {
        let is_corners =
            |p: &Property| p.length.is_some() && ["vertex_indices", "vertex_index"].contains(&&*p.name);
        let corners_at =
            self.properties.iter().position(is_corners).ok_or("there is no list vertex_indices")?;
        let mut corners = Vec::new();
        for _ in 0..self.count {
            corners.clear();
            for (i, property) in self.properties.iter().enumerate() {
                property.read(values, |value| {
                    if i == corners_at {
                        corners.push(value);
                    }
                })?;
            }
            if corners.iter().any(|&x| index(x).is_none()) {
                return Err(format!("a face has the corners {corners:?}"));
            }
            if corners.len() < 3 {
                return Err(format!("a face has {} corners", corners.len()));
            }
            let first = corners[0] as u32;
            kept.faces.extend(corners[1..].windows(2).map(|pair| [first, pair[0] as u32, pair[1] as u32]));
        }
        Ok(())
    }
}

/// A value as an index, if it is one.
fn index(value: f64) -> Option<u32> {
    (value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0).then_some(value as u32)
}

impl Property {
    /// Hands each value to `keep`: one, or those of the list.
    fn read(&self, values: &mut Values, mut keep: impl FnMut(f64)) -> Result<(), String> {
        let count = match self.length {
            None => 1.0,
            Some(kind) => values.next(kind)?,
        };
        if count < 0.0 || count.fract() != 0.0 {
            return Err(format!("a list has {count} entries"));
        }
        for _ in 0..count as u64 {
            keep(values.next(self.kind)?);
        }
        Ok(())
    }
}

/// The values behind the header. Every type of PLY is exact in an f64.
enum Values<'a> {
    /// Words of a text that so many lines stand above.
    Ascii {
        words: SplitAsciiWhitespace<'a>,
        text: &'a str,
        above: usize,
    },
    Binary {
        rest: &'a [u8],
        little: bool,
    },
}

impl Values<'_> {
    fn next(&mut self, kind: Kind) -> Result<f64, String> {
        match self {
            Self::Ascii { words, text, above } => {
                let word = words.next().ok_or("the file ends too early")?;
                word.parse().map_err(|_| {
                    let before = &text[..word.as_ptr().addr() - text.as_ptr().addr()];
                    let line = *above + before.matches('\n').count() + 1;
                    format!("\"{word}\" in line {line} is not a number")
                })
            }
            Self::Binary { rest, little } => {
                let little = *little;
                Ok(match kind {
                    Kind::I8 => f64::from(i8::from_le_bytes(take(rest, little)?)),
                    Kind::U8 => f64::from(u8::from_le_bytes(take(rest, little)?)),
                    Kind::I16 => f64::from(i16::from_le_bytes(take(rest, little)?)),
                    Kind::U16 => f64::from(u16::from_le_bytes(take(rest, little)?)),
                    Kind::I32 => f64::from(i32::from_le_bytes(take(rest, little)?)),
                    Kind::U32 => f64::from(u32::from_le_bytes(take(rest, little)?)),
                    Kind::F32 => f64::from(f32::from_le_bytes(take(rest, little)?)),
                    Kind::F64 => f64::from_le_bytes(take(rest, little)?),
                })
            }
        }
    }
}

/// Takes the next `N` bytes, turned to little-endian.
fn take<const N: usize>(rest: &mut &[u8], little: bool) -> Result<[u8; N], String> {
    let (&value, behind) = rest.split_first_chunk::<N>().ok_or("the file ends too early")?;
    *rest = behind;
    let mut bytes: [u8; N] = value;
    if !little {
        bytes.reverse();
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square with a colour and a list at each vertex, an element of no use, and a face with a flag.
    const PROPERTIES: &str = "comment none\nelement vertex 4\nproperty double x\nproperty uchar red\n\
        property list uchar short odd\nproperty float y\nproperty float z\nelement thing 2\nproperty int a\n\
        element face 1\nproperty char flag\nproperty list uint ushort vertex_index\nend_header\n";

    fn ascii() -> Vec<u8> {
        let values = "0 9 0 0 5\n1 9 2 -7 7 0 5\n1 9 0 1 5\n0 9 0 1 5\n4\n5\n-1 4 0 1 2 3\n";
        format!("ply\r\nformat ascii 1.0\n{PROPERTIES}{values}").into_bytes()
    }

    fn binary(little: bool) -> Vec<u8> {
        let order = if little { "little" } else { "big" };
        let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\n{PROPERTIES}").into_bytes();
        let mut put = |value: &[u8]| {
            let mut value = value.to_vec();
            if !little {
                value.reverse();
            }
            bytes.extend(value);
        };
        for (x, odd, y) in
            [(0.0_f64, &[][..], 0.0_f32), (1.0, &[-7_i16, 7], 0.0), (1.0, &[], 1.0), (0.0, &[], 1.0)]
        {
            put(&x.to_le_bytes());
            put(&[9]);
            put(&[odd.len() as u8]);
            odd.iter().for_each(|value| put(&value.to_le_bytes()));
            put(&y.to_le_bytes());
            put(&5_f32.to_le_bytes());
        }
        [4_i32, 5].iter().for_each(|value| put(&value.to_le_bytes()));
        put(&[0xff]);
        put(&4_u32.to_le_bytes());
        [0_u16, 1, 2, 3].iter().for_each(|value| put(&value.to_le_bytes()));
        bytes
    }

    #[test]
    fn the_three_formats_give_the_same_mesh() {
        let parsed = parse(&ascii()).unwrap();
        let Geometry::Mesh { mesh, .. } = &parsed else { panic!("{parsed:?}") };
        assert_eq!(
            mesh.vertices,
            [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 1.0, 5.0]].map(Point3::from)
        );
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(parse(&binary(true)).unwrap(), parsed);
        assert_eq!(parse(&binary(false)).unwrap(), parsed);
    }

    #[test]
    fn a_file_cut_anywhere_is_an_error() {
        for whole in [binary(true), binary(false)] {
            for length in 0..whole.len() {
                assert!(parse(&whole[..length]).is_err(), "{length}");
            }
        }
        // Of text, the last digit and the line end may go unnoticed.
        let whole = ascii();
        for length in 0..whole.len() - 2 {
            assert!(parse(&whole[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn a_bit_turned_anywhere_does_not_panic() {
        for whole in [ascii(), binary(true), binary(false)] {
            for place in 0..whole.len() * 8 {
                let mut bytes = whole.clone();
                bytes[place / 8] ^= 1 << (place % 8);
                let _ = parse(&bytes);
            }
        }
    }

    #[test]
    fn counts_that_lie_neither_allocate_nor_hang() {
        let with = |elements: &str| {
            parse(format!("ply\nformat binary_little_endian 1.0\n{elements}end_header\n12345678").as_bytes())
        };
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        let list = "property list uint uchar vertex_indices\n";
        assert!(with(&format!("element vertex 18446744073709551615\n{xyz}")).is_err());
        assert!(with(&format!("element face 4294967295\n{list}")).is_err());
        assert!(with("element nothing 18446744073709551615\n").is_ok());
        assert!(with("element thing 1\nproperty list double uchar many\n").is_err());
        assert!(with(&format!("element vertex -1\n{xyz}")).is_err());
    }
}
