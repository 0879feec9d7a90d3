//! What a run says: numbers, words, pictures.

pub mod words;
