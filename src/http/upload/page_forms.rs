//! Uploads of pages: their pictures, and what is put right on them.

use std::collections::BTreeMap;

use bytes::Bytes;
use multer::Field;

use super::Form;
use super::document::Document;
use super::page::page_part;
use super::parts::{FilePart, expect_new, part_name, read_picture, read_text};
use crate::http::HttpLimits;
use crate::http::problem::{Problem, TOO_MANY_VIEWS, UNKNOWN_PART};
use ::page::PageOptions;

/// The parts of a new page.
#[derive(Debug, Default)]
pub(in crate::http) struct PageForm {
    pages: Vec<Bytes>,
    azimuths: Option<String>,
}

impl PageForm {
    /// The pictures as they came, and the azimuths of their figures.
    pub(in crate::http) fn into_parts(self) -> (Vec<Bytes>, Option<String>) {
        (self.pages, self.azimuths)
    }
}

impl Form for PageForm {
    async fn read_one(&mut self, field: Field<'_>, limits: &HttpLimits) -> Result<(), Problem> {
        let name = part_name(&field)?;
        match name.as_str() {
            "page" => {
                let most = PageOptions::default().max_figures;
                if self.pages.len() >= most {
                    let detail = format!("the page has more than {most} pictures; send fewer");
                    return Err(Problem::new(TOO_MANY_VIEWS, detail).part(name));
                }
                let part = page_part(self.pages.len());
                self.pages.push(read_picture(field, part, limits).await?.bytes);
            }
            "azimuths" => {
                expect_new(self.azimuths.is_none(), &name)?;
                self.azimuths = Some(read_text(field, &name).await?);
            }
            _ => {
                let detail =
                    format!("`{name}` is no part of a page; parts are `page` and `azimuths`");
                return Err(Problem::new(UNKNOWN_PART, detail).part(name));
            }
        }
        Ok(())
    }
}

/// The parts of a page that is put right.
#[derive(Debug, Default)]
pub(in crate::http) struct EditForm {
    pub document: Option<Document>,
    /// By number of the figure.
    pub masks: BTreeMap<usize, FilePart>,
}

impl Form for EditForm {
    async fn read_one(&mut self, field: Field<'_>, limits: &HttpLimits) -> Result<(), Problem> {
        let name = part_name(&field)?;
        let number = name.strip_prefix("mask[").and_then(|rest| rest.strip_suffix(']'));
        match (name.as_str(), number.and_then(|number| number.parse::<usize>().ok())) {
            ("document", _) => {
                expect_new(self.document.is_none(), &name)?;
                self.document = Some(Document::read(field, &name, limits).await?);
            }
            (_, Some(number)) => {
                expect_new(!self.masks.contains_key(&number), &name)?;
                self.masks.insert(number, read_picture(field, name, limits).await?);
            }
            _ => {
                let detail = format!(
                    "`{name}` is no part of an edited page; parts are `document` and `mask[0]`, numbered like its figures"
                );
                return Err(Problem::new(UNKNOWN_PART, detail).part(name));
            }
        }
        Ok(())
    }
}
