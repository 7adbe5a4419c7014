//! Finds the text that a JSON pointer means, so that a message can show the line.

use std::fmt;
use std::ops::Range;

/// Bytes of the value at `pointer` (RFC 6901, without `~` escapes) in valid JSON `text`; for an object or
/// array its opening bracket alone. `None` where it is absent.
pub(crate) fn locate(text: &str, pointer: &str) -> Option<Range<usize>> {
    let mut cursor = Cursor { bytes: text.as_bytes(), at: 0 };
    for segment in pointer.split('/').skip(1) {
        cursor.skip_space();
        match cursor.next()? {
            b'{' => cursor.enter_member(segment)?,
            b'[' => cursor.enter_element(segment.parse().ok()?)?,
            _ => return None,
        }
    }
    cursor.skip_space();
    let start = cursor.at;
    if matches!(cursor.peek()?, b'{' | b'[') {
        return Some(start..start + 1);
    }
    cursor.skip_value()?;
    Some(start..cursor.at)
}

/// JSON pointer of the innermost value around byte `at`, the inverse of [`locate`]; at a closing bracket the value
/// that ends there. `text` may be broken from there on.
pub(crate) fn pointer_at(text: &str, at: usize) -> String {
    let mut cursor = Cursor { bytes: text.as_bytes().get(..=at).unwrap_or(text.as_bytes()), at: 0 };
    let mut path: Vec<Step> = Vec::new();
    while let Some(byte) = cursor.peek() {
        match byte {
            b'{' => path.push(Step::Member { key: String::new(), is_known: false }),
            b'[' => path.push(Step::Element(0)),
            b'}' | b']' => {
                path.pop();
                if cursor.at == at {
                    break;
                }
            }
            b',' => match path.last_mut() {
                Some(Step::Element(index)) => *index += 1,
                Some(Step::Member { is_known, .. }) => *is_known = false,
                None => {}
            },
            b'"' => {
                let start = cursor.at + 1;
                let is_whole = cursor.skip_string().is_some();
                if let Some(Step::Member { key, is_known: is_known @ false }) = path.last_mut()
                    && is_whole
                {
                    text.get(start..cursor.at - 1).unwrap_or_default().clone_into(key);
                    *is_known = true;
                }
                continue;
            }
            _ => {}
        }
        cursor.at += 1;
    }
    path.iter().map(Step::to_string).collect()
}

/// A step of a JSON pointer.
enum Step {
    Member { key: String, is_known: bool },
    Element(usize),
}

impl fmt::Display for Step {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Step::Member { is_known: false, .. } => Ok(()),
            Step::Member { key, .. } => write!(formatter, "/{}", key.replace('~', "~0").replace('/', "~1")),
            Step::Element(index) => write!(formatter, "/{index}"),
        }
    }
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn next(&mut self) -> Option<u8> {
        let byte = self.peek()?;
        self.at += 1;
        Some(byte)
    }

    fn skip_space(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\n' | b'\r' | b',' | b':')) {
            self.at += 1;
        }
    }

    fn enter_member(&mut self, name: &str) -> Option<()> {
        loop {
            self.skip_space();
            let start = self.at;
            if self.peek()? != b'"' {
                return None;
            }
            self.skip_string()?;
            if self.bytes.get(start + 1..self.at - 1)? == name.as_bytes() {
                return Some(());
            }
            self.skip_space();
            self.skip_value()?;
        }
    }

    fn enter_element(&mut self, index: usize) -> Option<()> {
        for _ in 0..index {
            self.skip_space();
            self.skip_value()?;
        }
        self.skip_space();
        (self.peek()? != b']').then_some(())
    }

    fn skip_string(&mut self) -> Option<()> {
        self.at += 1;
        loop {
            match self.next()? {
                b'\\' => self.at += 1,
                b'"' => return Some(()),
                _ => {}
            }
        }
    }

    /// Iterative, because depth is the file's to choose.
    fn skip_value(&mut self) -> Option<()> {
        let mut depth = 0usize;
        loop {
            match self.peek()? {
                b'"' => self.skip_string()?,
                b'{' | b'[' => {
                    depth += 1;
                    self.at += 1;
                }
                b'}' | b']' => {
                    depth = depth.checked_sub(1)?;
                    self.at += 1;
                }
                _ => self.skip_atom()?,
            }
            if depth == 0 {
                return Some(());
            }
            self.skip_space();
        }
    }

    fn skip_atom(&mut self) -> Option<()> {
        let start = self.at;
        while self.peek().is_some_and(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte)) {
            self.at += 1;
        }
        (self.at > start).then_some(())
    }
}
