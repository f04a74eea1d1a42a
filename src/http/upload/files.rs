//! The files beside an uploaded sheet document, found by their names.

use super::assemble::Picture;
use super::fetch::is_url;
use super::parts::FilePart;
use crate::http::problem::{INVALID_SHEET, MISSING_FILE, Problem, UNKNOWN_PART};

/// The files of a sheet form, found by the names in the document.
pub(super) struct Files(Vec<(FilePart, bool)>);

impl Files {
    pub(super) fn new(files: impl IntoIterator<Item = FilePart>) -> Self {
        Self(files.into_iter().map(|file| (file, false)).collect())
    }

    /// The file that the document calls `name`.
    pub(super) fn take(&mut self, name: &str) -> Result<Picture, Problem> {
        self.take_if_sent(name)?.ok_or_else(|| {
            let detail = if is_url(name) {
                format!(
                    "the sheet names `{name}`, and this service fetches nothing; send the file itself, or have fetching allowed with --inputs-by-url"
                )
            } else {
                format!(
                    "the sheet names `{name}`, but no such file was sent; add -F 'image=@{name}'"
                )
            };
            Problem::new(MISSING_FILE, detail).part(name)
        })
    }

    /// The file that the document calls `name`, if there is one. Clients send a
    /// file's last name only, so `front/a.png` is also found as `a.png`.
    pub(super) fn take_if_sent(&mut self, name: &str) -> Result<Option<Picture>, Problem> {
        let last = name.rsplit(['/', '\\']).next().unwrap_or(name);
        let found = [name, last]
            .into_iter()
            .find_map(|wanted| self.0.iter().position(|(file, _)| file.file == wanted));
        let Some((file, used)) = found.and_then(|at| self.0.get_mut(at)) else {
            return Ok(None);
        };
        if std::mem::replace(used, true) {
            let detail = format!("two names in the sheet lead to the file `{}`", file.file);
            return Err(Problem::new(INVALID_SHEET, detail).part("sheet"));
        }
        Ok(Some(file.clone().into()))
    }

    pub(super) fn expect_all_used(&self) -> Result<(), Problem> {
        let unused = self.0.iter().find(|(_, used)| !used);
        unused.map_or(Ok(()), |(file, _)| {
            let detail = format!(
                "the sheet names no file `{}`; only drawings, masks and truth are taken",
                file.file
            );
            Err(Problem::new(UNKNOWN_PART, detail).part(&*file.file))
        })
    }
}
