//! Where a module path is looked up.

/// Files that the module path `path`, imported by the file `importer`, may stand for; the first that
/// exists is taken.
///
/// - `lib::brdf` is `lib/brdf.wgsl` in the importer's folder, then in each parent folder up to the project.
/// - `super::brdf` is `brdf.wgsl` in the importer's folder only; each further `super` goes one folder up.
/// - `package::lib::brdf` is `lib/brdf.wgsl` in the project's folder only.
///
/// `None`: the path has no module in it, or `super` leaves the project.
pub fn candidates(importer: &str, path: &[String]) -> Option<Vec<String>> {
    let mut folders = folders_of(importer);
    let supers = path.iter().take_while(|part| *part == "super").count();
    let (folders, parts) = if path.first().is_some_and(|part| part == "package") {
        (vec![String::new()], &path[1..])
    } else if supers > 0 {
        let folder = (supers <= folders.len()).then(|| folders.swap_remove(supers - 1))?;
        (vec![folder], &path[supers..])
    } else {
        (folders, path)
    };
    let file = parts.join("/");
    (!file.is_empty()).then(|| folders.into_iter().map(|folder| format!("{folder}{file}.wgsl")).collect())
}

/// The folder of `file` and its parents, nearest first, each with a `/` at its end; the project's is empty.
fn folders_of(file: &str) -> Vec<String> {
    let mut folders: Vec<String> = file.match_indices('/').map(|(at, _)| file[..=at].to_owned()).collect();
    folders.reverse();
    folders.push(String::new());
    folders
}
