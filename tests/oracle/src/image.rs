//! Images of the firmware, read as files: functions and their code, the vector table, the places of panics.

use object::{Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};
use rustc_demangle::demangle;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use tempfile::NamedTempFile;

/// The section of the stack's start and of all handlers.
const VECTORS: &str = ".vector_table";
/// Bytes of a word.
const WORD: usize = 4;

/// A function of an image.
#[derive(Clone, Debug)]
pub struct Function {
    /// Its path, without what a compiler adds to tell instances apart.
    pub name: String,
    /// Its first address.
    pub start: u32,
    /// The first address behind it.
    pub end: u32,
}

/// An image.
#[derive(Debug)]
pub struct Image {
    /// What it is called.
    pub name: String,
    sections: Vec<(u32, Vec<u8>)>,
    vectors: Vec<u32>,
    symbols: BTreeMap<String, u32>,
    functions: BTreeMap<u32, Function>,
    /// Where code begins (true) and where data does.
    kinds: BTreeMap<u32, bool>,
}

/// Where a panic says that it is: file, line and column.
pub type Location = (String, u32, u32);

impl Image {
    /// Read an image.
    ///
    /// # Panics
    /// When it is none of this firmware.
    pub fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let file = object::File::parse(&*bytes).unwrap();
        let (mut symbols, mut starts, mut kinds) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        for symbol in file.symbols() {
            let (name, address) = (symbol.name().unwrap(), symbol.address() as u32);
            match (name.as_bytes(), symbol.kind()) {
                ([b'$', kind @ (b't' | b'd'), ..], _) => {
                    kinds.insert(address, *kind == b't');
                }
                // Of names for one function the first will do.
                (_, SymbolKind::Text) => {
                    starts
                        .entry(address & !1)
                        .or_insert((format!("{:#}", demangle(name)), symbol.size() as u32));
                }
                _ => {}
            }
            symbols.insert(name.to_owned(), address);
        }
        let begins: Vec<_> = starts.keys().copied().collect();
        let functions = starts.into_iter().map(|(start, (name, size))| {
            // What is written in assembly may not say how long it is.
            let next = begins.iter().find(|other| **other > start).copied().unwrap_or(u32::MAX);
            let end = if size == 0 { next } else { start + size };
            (start, Function { name, start, end })
        });
        let section = |name: &str| file.section_by_name(name).unwrap_or_else(|| panic!("no {name}"));
        let words = |bytes: &[u8]| -> Vec<u32> {
            bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
        };
        Self {
            name: path.file_name().unwrap().to_string_lossy().into_owned(),
            sections: [".text", ".rodata"]
                .map(|name| (section(name).address() as u32, section(name).data().unwrap().to_vec()))
                .to_vec(),
            vectors: words(section(VECTORS).data().unwrap()),
            functions: functions.collect(),
            symbols,
            kinds,
        }
    }

    /// The code or the constants from an address on.
    pub fn at(&self, address: u32) -> Option<&[u8]> {
        self.sections.iter().find_map(|(start, bytes)| {
            let rest = bytes.get(address.checked_sub(*start)? as usize..)?;
            (!rest.is_empty()).then_some(rest)
        })
    }

    /// Whether there is code at an address, and no data.
    pub fn is_code(&self, address: u32) -> bool {
        self.kinds.range(..=address).next_back().is_some_and(|(_, code)| *code)
    }

    /// Where code goes on at or behind an address.
    pub fn code_behind(&self, address: u32) -> u32 {
        self.kinds.range(address..).find(|(_, code)| **code).map_or(u32::MAX, |(address, _)| *address)
    }

    /// The function that an address lies in.
    pub fn function_at(&self, address: u32) -> Option<&Function> {
        let (_, function) = self.functions.range(..=address).next_back()?;
        (address < function.end).then_some(function)
    }

    /// All functions.
    pub fn functions(&self) -> impl Iterator<Item = &Function> {
        self.functions.values()
    }

    /// What handles the reset, and then each exception and interrupt that anything handles.
    pub fn entries(&self) -> Vec<&Function> {
        let mut entries = Vec::<&Function>::new();
        for address in self.vectors.iter().skip(1).filter(|address| **address != 0) {
            let entry = self.function_at(address & !1).expect("vectors are functions");
            if entries.iter().all(|other| other.start != entry.start) {
                entries.push(entry);
            }
        }
        entries
    }

    /// The addresses that the stack has.
    pub fn stack(&self) -> Range<u32> {
        self.symbols["_stack_end"]..self.symbols["_stack_start"]
    }

    /// Where the vector table lies, whose first word is where the stack begins.
    pub fn vectors(&self) -> u32 {
        self.symbols["__vector_table"]
    }

    /// What is logged by defmt before a panic, in order: the package, and the sentence. Names of symbols have it.
    pub fn logged_panics(&self) -> Vec<(String, String)> {
        let logged = |name: &String| {
            let log: serde_json::Value = serde_json::from_str(name).ok()?;
            let sentence = log["data"].as_str()?.strip_prefix("panicked at ")?;
            let words: Vec<_> = sentence.split_whitespace().collect();
            Some((log["package"].as_str()?.to_owned(), words.join(" ")))
        };
        let mut panics: Vec<_> = self.symbols.keys().filter_map(logged).collect();
        panics.sort();
        panics.dedup();
        panics
    }

    /// Where panics say that they are, in order: every such place that the linker found a use for. It is a path,
    /// its length, a line and a column.
    pub fn panics(&self) -> Vec<Location> {
        let (start, constants) = &self.sections[1];
        let place = |at: usize| -> Option<Location> {
            let word = |i: usize| {
                let bytes = constants.get(at + WORD * i..)?.first_chunk()?;
                Some(u32::from_le_bytes(*bytes))
            };
            let (from, length) = (word(0)?.checked_sub(*start)? as usize, word(1)? as usize);
            let file = std::str::from_utf8(constants.get(from..from.checked_add(length)?)?).ok()?;
            (file.len() > 3 && file.ends_with(".rs")).then_some((file.to_owned(), word(2)?, word(3)?))
        };
        let mut places: Vec<_> = (0..constants.len()).step_by(WORD).filter_map(place).collect();
        places.sort();
        places.dedup();
        places
    }
}

/// A copy of an image that has other bytes at an address.
///
/// # Panics
/// When there is nothing in the image at that address.
pub fn patched(path: &Path, address: u32, bytes: &[u8]) -> NamedTempFile {
    let mut copy = std::fs::read(path).unwrap();
    let place = {
        let file = object::File::parse(&*copy).unwrap();
        let offset = |section: object::Section<'_, '_>| {
            let (from, length) = section.file_range()?;
            let within = u64::from(address).checked_sub(section.address())?;
            (section.kind() != SectionKind::UninitializedData && within < length)
                .then(|| (from + within) as usize)
        };
        file.sections()
            .filter(|section| section.address() > 0 || section.name() == Ok(VECTORS))
            .find_map(offset)
    };
    let place = place.unwrap_or_else(|| panic!("the image has nothing at {address:#x}"));
    copy[place..place + bytes.len()].copy_from_slice(bytes);
    let file = NamedTempFile::new().unwrap();
    std::fs::write(file.path(), copy).unwrap();
    file
}
