//! Finds the text that a JSON pointer means, so that a message can show the line.

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

/// JSON pointer of the innermost value around byte `at`, the inverse of [`locate`]; for text that may be broken
/// from there on.
pub(crate) fn pointer_at(text: &str, at: usize) -> String {
    enum Step {
        Key(String),
        Index(usize),
    }
    let mut cursor = Cursor { bytes: text.as_bytes().get(..=at).unwrap_or(text.as_bytes()), at: 0 };
    let (mut path, mut expects_key): (Vec<Step>, bool) = (Vec::new(), false);
    while let Some(byte) = cursor.peek() {
        match byte {
            // The value that ends here may be the culprit.
            b'}' | b']' if cursor.at == at => break,
            b'{' => (path.push(Step::Key(String::new())), expects_key = true).0,
            b'[' => path.push(Step::Index(0)),
            b'}' | b']' => drop(path.pop()),
            b',' => match path.last_mut() {
                Some(Step::Index(index)) => *index += 1,
                Some(Step::Key(key)) => (key.clear(), expects_key = true).0,
                None => {}
            },
            b'"' => {
                let start = cursor.at;
                let is_whole = cursor.skip_string().is_some();
                if let (Some(Step::Key(key)), true, true) = (path.last_mut(), expects_key, is_whole) {
                    text.get(start + 1..cursor.at - 1).unwrap_or_default().clone_into(key);
                    expects_key = false;
                }
                continue;
            }
            _ => {}
        }
        cursor.at += 1;
    }
    let mut pointer = String::new();
    for step in path {
        match step {
            Step::Key(key) if key.is_empty() => {}
            Step::Key(key) => pointer = format!("{pointer}/{}", key.replace('~', "~0").replace('/', "~1")),
            Step::Index(index) => pointer = format!("{pointer}/{index}"),
        }
    }
    pointer
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
