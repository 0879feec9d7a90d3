//! Who is let in: whoever knows the token, at an address of this machine, from no other page than ours.
//!
//! * **In**: a request's path, Host and Origin. **Out**: the path below the token, or why it is refused.
//!
//! The server listens on loopback alone. A page of somebody else in the same browser reaches that too, so: a Host
//! that is a name of somebody's (DNS rebinding) is refused, and so is a foreign Origin; and without the token, which
//! only the terminal has seen, nothing is told.

use std::fmt::Write as _;

/// Bytes of the token.
const TOKEN: usize = 16;

/// What a request must know.
#[derive(Debug)]
pub(super) struct Guard {
    /// Hexadecimal.
    token: String,
    /// What this machine is called by those who mean it.
    hosts: [String; 2],
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Stranger {
    #[error("this page is for this machine alone, at the address that the program printed")]
    Host,
    #[error(
        "another page has asked for this; open the address that the program printed, in a window of its own"
    )]
    Origin,
    #[error(
        "the token in the address is not the one of this run; open the address that the program printed last"
    )]
    Token,
}

impl Guard {
    /// A new token, for a port of this machine.
    pub(super) fn new(port: u16) -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN];
        getrandom::fill(&mut bytes)?;
        Ok(Self::of(&bytes, port))
    }

    fn of(bytes: &[u8], port: u16) -> Self {
        let mut token = String::new();
        for byte in bytes {
            // Writing to a string does not fail.
            let _ = write!(token, "{byte:02x}");
        }
        // A browser leaves out the port that is usual.
        let port = if port == 80 { String::new() } else { format!(":{port}") };
        Self { token, hosts: ["127.0.0.1", "localhost"].map(|name| format!("{name}{port}")) }
    }

    /// Where the page is.
    pub(super) fn address(&self) -> String {
        format!("http://{}/{}/", self.hosts[0], self.token)
    }

    /// The path below the token.
    pub(super) fn admit<'p>(
        &self,
        path: &'p str,
        host: Option<&str>,
        origin: Option<&str>,
    ) -> Result<&'p str, Stranger> {
        let host = host.filter(|host| self.hosts.iter().any(|ours| ours == host)).ok_or(Stranger::Host)?;
        if origin.is_some_and(|origin| origin.strip_prefix("http://") != Some(host)) {
            return Err(Stranger::Origin);
        }
        let path = path.strip_prefix('/').unwrap_or(path);
        let (token, below) = path.split_once('/').unwrap_or((path, ""));
        if same(token.as_bytes(), self.token.as_bytes()) { Ok(below) } else { Err(Stranger::Token) }
    }
}

/// Whether two texts are the same, in a time that does not tell how much of them is.
fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |different, (a, b)| different | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: Option<&str> = Some("127.0.0.1:8080");

    fn guard() -> Guard {
        Guard::of(&[0xab, 0x01], 8080)
    }

    #[test]
    fn who_has_the_address_is_let_in() {
        let guard = guard();
        assert_eq!(guard.address(), "http://127.0.0.1:8080/ab01/");
        assert_eq!(guard.admit("/ab01/", OURS, None), Ok(""));
        assert_eq!(guard.admit("/ab01", OURS, None), Ok(""));
        assert_eq!(guard.admit("/ab01/pair", OURS, Some("http://127.0.0.1:8080")), Ok("pair"));
        assert_eq!(
            guard.admit("/ab01/pair", Some("localhost:8080"), Some("http://localhost:8080")),
            Ok("pair")
        );
    }

    #[test]
    fn tokens_are_long_and_differ() {
        let [a, b] = [0; 2].map(|_| Guard::new(1).unwrap().token);
        assert!(a.len() == 2 * TOKEN && a != b, "{a} {b}");
    }

    #[test]
    fn who_has_not_is_refused() {
        let guard = guard();
        for path in ["", "/", "/ab0", "/ab011/", "/ab02/", "//ab01/", "/AB01/", "/pair"] {
            assert_eq!(guard.admit(path, OURS, None), Err(Stranger::Token), "{path}");
        }
    }

    #[test]
    fn names_of_others_are_refused_even_with_the_token() {
        let guard = guard();
        let hosts = [
            "evil.example:8080",
            "127.0.0.1",
            "127.0.0.1:80",
            "127.0.0.1.evil.example:8080",
            "[::1]:8080",
            "",
        ];
        for host in hosts.map(Some).into_iter().chain([None]) {
            assert_eq!(guard.admit("/ab01/", host, None), Err(Stranger::Host), "{host:?}");
        }
        for origin in ["http://evil.example", "https://127.0.0.1:8080", "http://localhost:8080", "null", ""] {
            assert_eq!(guard.admit("/ab01/", OURS, Some(origin)), Err(Stranger::Origin), "{origin}");
        }
    }

    #[test]
    fn the_usual_port_is_left_out() {
        let guard = Guard::of(&[1], 80);
        assert_eq!(guard.admit("/01/", Some("127.0.0.1"), Some("http://127.0.0.1")), Ok(""));
        assert_eq!(guard.address(), "http://127.0.0.1/01/");
    }
}
