//! A gate's page: the sentence that it quotes.

/// Longest line of a document, in characters.
const WIDTH: usize = 118;

/// The quoted sentence of a page, its lines joined.
pub fn quoted(page: &str) -> String {
    let lines = page.lines().filter_map(|line| line.strip_prefix("> "));
    lines.collect::<Vec<_>>().join(" ")
}

/// The page with another sentence quoted.
pub fn renewed(page: &str, sentence: &str) -> String {
    let mut renewed = String::new();
    let mut quote = Some(wrapped(sentence));
    for line in page.lines() {
        if !line.starts_with("> ") {
            renewed.extend([line, "\n"]);
        } else if let Some(quote) = quote.take() {
            renewed.push_str(&quote);
        }
    }
    renewed
}

/// A sentence as quoted lines.
fn wrapped(sentence: &str) -> String {
    let mut lines = vec![String::from(">")];
    for word in sentence.split_whitespace() {
        let fits = lines.last().is_some_and(|line| line.chars().count() + word.chars().count() < WIDTH);
        if !fits {
            lines.push(String::from(">"));
        }
        if let Some(line) = lines.last_mut() {
            line.extend([" ", word]);
        }
    }
    lines.join("\n") + "\n"
}
