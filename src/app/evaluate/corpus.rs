//! What is evaluated: folders of sheets and of 3D models, and what an index
//! says of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use mesh::read::ModelFormat;

/// A share of the truth's inside that an index calls closed, from here on.
const CLOSED: f64 = 0.6;

/// A sheet or a 3D model with its truth.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Subject {
    /// Of its folder or file, without the ending.
    pub name: String,
    pub source: Source,
    /// What the index says of it.
    pub entry: Entry,
}

/// Where a subject is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Source {
    /// A folder with `sheet.json`.
    Sheet(PathBuf),
    /// A file that is drawn first.
    Model(PathBuf),
}

/// What an index says of a subject.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Entry {
    pub kind: Option<String>,
    /// Whether the truth encloses what it seems to; `None` if it is not said.
    pub closed: Option<bool>,
}

/// The subjects at `paths`, in their order, those of a folder by name.
///
/// A path is a sheet's folder, a model, or a folder of such; other files in
/// folders are passed over.
///
/// # Errors
/// A path that cannot be read or holds no subject, and two subjects of one name.
pub(super) fn subjects(
    paths: &[PathBuf],
    index: &BTreeMap<String, Entry>,
    only: &[String],
) -> Result<Vec<Subject>> {
    let mut found: Vec<Subject> = Vec::new();
    for path in paths {
        let before = found.len();
        if let Some(subject) = subject(path, index, true) {
            found.push(subject);
        } else {
            let named = || path.display().to_string();
            let mut inside: Vec<PathBuf> = fs::read_dir(path)
                .with_context(named)?
                .map(|entry| entry.map(|entry| entry.path()))
                .collect::<Result<_, _>>()
                .with_context(named)?;
            inside.sort();
            found.extend(inside.iter().filter_map(|path| subject(path, index, false)));
        }
        if found.len() == before {
            bail!("{}: holds no sheet.json and no model (glb, obj)", path.display());
        }
    }
    found.retain(|subject| only.is_empty() || only.contains(&subject.name));
    if found.is_empty() {
        bail!("--only: none of the subjects has such a name");
    }
    for (index, subject) in found.iter().enumerate() {
        if found[..index].iter().any(|other| other.name == subject.name) {
            bail!("two subjects are called {}; evaluate them one by one", subject.name);
        }
    }
    Ok(found)
}

/// * `named`: whether somebody named the path, so that any model format will do.
fn subject(path: &Path, index: &BTreeMap<String, Entry>, named: bool) -> Option<Subject> {
    let is_sheet = path.join("sheet.json").is_file();
    let format = ModelFormat::from_file_name(&path.to_string_lossy());
    let is_model = path.is_file()
        && (format.is_some() && named
            || matches!(format, Some(ModelFormat::Glb | ModelFormat::Obj)));
    let (name, source) = if is_sheet {
        (path.file_name()?, Source::Sheet(path.to_owned()))
    } else if is_model {
        (path.file_stem()?, Source::Model(path.to_owned()))
    } else {
        return None;
    };
    let name = name.to_string_lossy().into_owned();
    let entry = index.get(&name).cloned().unwrap_or_default();
    Some(Subject { name, source, entry })
}

/// Reads an index: Markdown tables with a column `name`, and maybe `kind` and
/// `solid`, the share of the truth's inside that is closed in.
pub(super) fn index(text: &str) -> BTreeMap<String, Entry> {
    let mut entries = BTreeMap::new();
    let mut columns: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim) {
        let Some(row) = line.strip_prefix('|') else {
            columns.clear();
            continue;
        };
        let cells: Vec<&str> = row.strip_suffix('|').unwrap_or(row).split('|').collect();
        let cells: Vec<&str> = cells.into_iter().map(str::trim).collect();
        if columns.is_empty() {
            columns = cells.iter().map(|cell| cell.to_lowercase()).collect();
            continue;
        }
        let cell = |column: &str| {
            let at = columns.iter().position(|name| name == column)?;
            cells.get(at).copied().filter(|cell| !cell.is_empty())
        };
        let Some(name) = cell("name").filter(|name| !name.starts_with("---")) else { continue };
        let solid = cell("solid").map(|share| share.parse().is_ok_and(|s: f64| s >= CLOSED));
        let entry = Entry { kind: cell("kind").map(str::to_owned), closed: solid };
        entries.insert(name.to_owned(), entry);
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    const INDEX: &str = "# Corpus\n\ntext | with a bar\n\n| name | kind | source | solid |\n\
                         |---|---|---|---|\n| fox | quadruped | a b | 0.97 |\n\
                         | cart | vehicle | c | 0.02 |\n| axe | weapon | d | - |\n\n\
                         | name | solid |\n|---|---|\n| cup | 0.6 |\n";

    #[test]
    fn an_index_gives_kinds_and_closed_truths() {
        let found = index(INDEX);
        assert_eq!(found.len(), 4);
        let entry = |name: &str| found[name].clone();
        assert_eq!(entry("fox"), Entry { kind: Some("quadruped".into()), closed: Some(true) });
        assert_eq!(entry("cart").closed, Some(false));
        assert_eq!(entry("axe").closed, Some(false));
        assert_eq!(entry("cup"), Entry { kind: None, closed: Some(true) });
    }

    #[test]
    fn folders_are_searched_and_other_files_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sheet_a")).unwrap();
        fs::write(at("sheet_a/sheet.json"), "{}").unwrap();
        fs::create_dir(at("nothing")).unwrap();
        for name in ["fox.glb", "INDEX.md", "overview.png", "cart.OBJ", "cup.stl"] {
            fs::write(at(name), "").unwrap();
        }
        let all = subjects(&[folder.path().to_owned()], &index(INDEX), &[]).unwrap();
        let names: Vec<&str> = all.iter().map(|subject| subject.name.as_str()).collect();
        assert_eq!(names, ["cart", "fox", "sheet_a"]);
        assert_eq!(all[1].entry.kind.as_deref(), Some("quadruped"));
        assert_eq!(all[2].source, Source::Sheet(at("sheet_a")));
        // Named itself, any model is taken.
        assert_eq!(subjects(&[at("cup.stl")], &BTreeMap::new(), &[]).unwrap()[0].name, "cup");
        let only = subjects(&[folder.path().to_owned()], &BTreeMap::new(), &["fox".to_owned()]);
        assert_eq!(only.unwrap().len(), 1);
        let refused =
            |paths: &[PathBuf]| subjects(paths, &BTreeMap::new(), &[]).unwrap_err().to_string();
        assert!(refused(&[at("nothing")]).contains("holds no sheet.json"));
        assert!(refused(&[at("fox.glb"), folder.path().to_owned()]).contains("two subjects"));
        assert!(refused(&[at("missing")]).contains("missing"));
    }
}
