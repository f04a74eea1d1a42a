//! The options of an upload.

use multer::Field;
use serde_json::Value;

use super::document::Document;
use super::parts::{expect_new, read_text};
use crate::http::HttpLimits;
use crate::http::problem::{INVALID_OPTION, Problem};

/// The options of an upload as they came: a document, and single ones by their dotted names.
#[derive(Debug, Default)]
pub(crate) struct GivenOptions {
    document: Option<Document>,
    /// As nested objects.
    fields: Vec<(String, Value)>,
}

impl GivenOptions {
    pub(crate) async fn read_document(
        &mut self,
        field: Field<'_>,
        name: &str,
        limits: &HttpLimits,
    ) -> Result<(), Problem> {
        expect_new(self.document.is_none(), name)?;
        self.document = Some(Document::read(field, name, limits).await?);
        Ok(())
    }

    pub(crate) async fn read_field(
        &mut self,
        field: Field<'_>,
        name: String,
    ) -> Result<(), Problem> {
        expect_new(!self.fields.iter().any(|(known, _)| *known == name), &name)?;
        let value = options::nested(&name, &read_text(field, &name).await?);
        self.fields.push((name, value));
        Ok(())
    }

    /// All of them; later sources lie over earlier ones: `base`, the document, single ones.
    pub(crate) fn over(self, base: Value) -> Result<Value, Problem> {
        let mut all = base;
        let document = self.document.map(|document| document.parse::<Value>(INVALID_OPTION));
        let document = document.transpose()?.map(|value| ("options".to_owned(), value));
        for (part, value) in document.into_iter().chain(self.fields) {
            if !value.is_object() {
                let detail = "`options` must be a JSON object, nested by stage";
                return Err(Problem::new(INVALID_OPTION, detail).part(part));
            }
            options::merge(&mut all, value);
        }
        Ok(all)
    }
}
