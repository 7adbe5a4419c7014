//! What a client shows where no system says whose process it is: a number that only the daemon's user can read.

use std::fmt;
use std::fs;
use std::io::{self, Read, Write as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::Path;

use serde::{Deserialize, Serialize};

/// 256 bits that nobody guesses.
const BYTES: usize = 32;

/// A secret of one daemon: 64 hexadecimal digits, made anew whenever it begins to listen.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Token(String);

impl Token {
    /// A new one.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub(crate) fn random() -> io::Result<Token> {
        let mut bytes = [0; BYTES];
        fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        Ok(Token(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Writes it where only this user can read it.
    pub(crate) fn write(&self, path: &Path) -> io::Result<()> {
        match fs::remove_file(path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let mut file = fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)?;
        writeln!(file, "{}", self.0)
    }

    /// The token in a file.
    ///
    /// # Errors
    /// It cannot be read, others can read it too, or it holds something else.
    pub fn read(path: &Path) -> io::Result<Token> {
        let refused = |reason: String| io::Error::new(io::ErrorKind::InvalidData, reason);
        let mut file = fs::File::open(path)?;
        let metadata = file.metadata()?;
        if metadata.mode() & 0o077 != 0 || metadata.uid() != rustix::process::geteuid().as_raw() {
            return Err(refused("others can read it, or it is not yours: `chmod 600` it".to_owned()));
        }
        let mut text = String::new();
        Read::take(&mut file, 1024).read_to_string(&mut text)?;
        let text = text.trim();
        if text.len() != 2 * BYTES || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(refused("a token is 64 hexadecimal digits".to_owned()));
        }
        Ok(Token(text.to_ascii_lowercase()))
    }

    /// Whether both are the same; how long that takes says nothing of where they differ.
    pub(crate) fn is(&self, shown: &Token) -> bool {
        let differences =
            self.0.bytes().zip(shown.0.bytes()).fold(0, |all, (own, theirs)| all | (own ^ theirs));
        self.0.len() == shown.0.len() && differences == 0
    }

    #[cfg(test)]
    pub(crate) fn of_text(text: &str) -> Token {
        Token(text.to_owned())
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token")
    }
}
