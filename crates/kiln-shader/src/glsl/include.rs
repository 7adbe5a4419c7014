//! Where an `#include` is looked up.

/// How an include is spelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quotes {
    /// `"file"`
    Double,
    /// `<file>`
    Angle,
}

/// Files that `name`, included by the file `includer`, may stand for; the first that exists is taken.
///
/// - `"a/b.glsl"` is looked for in the includer's folder, then in the include folders in their order.
/// - `<a/b.glsl>` is looked for in the include folders, then in the includer's folder and each parent folder
///   up to the project's.
///
/// Empty: the name is absolute, or leaves the project from everywhere.
pub fn candidates(includer: &str, name: &str, quotes: Quotes, folders: &[String]) -> Vec<String> {
    let mut own = parents(includer);
    let listed = folders.iter().map(|folder| folder.trim_matches('/').to_owned());
    let searched: Vec<String> = match quotes {
        Quotes::Double => {
            own.truncate(1);
            own.into_iter().chain(listed).collect()
        }
        Quotes::Angle => listed.chain(own).collect(),
    };
    let mut found: Vec<String> = Vec::new();
    for folder in searched {
        found.extend(joined(&folder, name).filter(|path| !found.contains(path)));
    }
    found
}

/// The folder of `file` and its parents, nearest first; the project's is empty.
fn parents(file: &str) -> Vec<String> {
    let mut folders: Vec<String> = file.match_indices('/').map(|(at, _)| file[..at].to_owned()).collect();
    folders.reverse();
    folders.push(String::new());
    folders
}

/// `folder/name` without `.` and `..`.
fn joined(folder: &str, name: &str) -> Option<String> {
    if name.is_empty() || name.starts_with('/') || name.contains(['\\', ':', '\0']) {
        return None;
    }
    let mut parts: Vec<&str> = Vec::new();
    for part in folder.split('/').chain(name.split('/')) {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part),
        }
    }
    (!parts.is_empty()).then(|| parts.join("/"))
}

/// The name in the rest of an `#include` line, and how many bytes of it are the name with its quotes.
pub fn parse(rest: &str) -> Option<(&str, Quotes, usize)> {
    let (quotes, end) = match rest.bytes().next()? {
        b'"' => (Quotes::Double, '"'),
        b'<' => (Quotes::Angle, '>'),
        _ => return None,
    };
    let line = rest.lines().next()?;
    let len = line[1..].find(end)?;
    Some((&line[1..=len], quotes, len + 2))
}
