//! Decodes uploaded pictures, a few at once, to check them.

use std::sync::Arc;

use bytes::Bytes;
use futures::{StreamExt, TryStreamExt, stream};
use tokio::sync::Semaphore;

use crate::http::problem::{DAMAGED_IMAGE, NOT_AN_IMAGE, PART_TOO_LARGE, Problem, TOO_MANY_PIXELS};
use picture::{ImageError, ImageLimits};
use sheet::PictureSize;

/// Decodes at once, in all uploads together.
#[derive(Clone, Debug)]
pub(crate) struct Decoders {
    slots: Arc<Semaphore>,
    count: usize,
}

/// What decoding a picture told.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decoded {
    pub format: picture::Format,
    pub size: PictureSize,
}

impl Decoders {
    pub(crate) fn new(count: usize) -> Self {
        let count = count.max(1);
        Self { slots: Arc::new(Semaphore::new(count)), count }
    }

    /// How many decode at once.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Decodes every picture to its end on blocking threads, a few at a time,
    /// and throws the pixels away. The first bad picture ends it.
    pub(crate) async fn decode_all(
        &self,
        pictures: &[(&str, &Bytes)],
        limits: &ImageLimits,
    ) -> Result<Vec<Decoded>, Problem> {
        // Made before the stream, as futures that borrow nothing from it.
        let decodes: Vec<_> = pictures
            .iter()
            .map(|(part, bytes)| self.decode(part, (*bytes).clone(), *limits))
            .collect();
        stream::iter(decodes).buffered(self.count).try_collect().await
    }

    async fn decode(
        &self,
        part: &str,
        bytes: Bytes,
        limits: ImageLimits,
    ) -> Result<Decoded, Problem> {
        let decoded = self.run(move || decode(&bytes, &limits)).await?;
        decoded.map_err(|error| image_problem(part, &error))
    }

    /// Runs `work` on a blocking thread once there is a slot.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Problem> {
        let slot = self.slots.clone().acquire_owned().await;
        let done = tokio::task::spawn_blocking(move || {
            // Held here, so that an upload given up does not free the slot
            // while its file is still being decoded.
            let _slot = slot;
            work()
        });
        done.await.map_err(|error| Problem::internal("decoding a file", &error))
    }
}

fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Decoded, ImageError> {
    let (format, width, height) = picture::inspect(bytes, limits)?;
    picture::decode(bytes, limits)?;
    Ok(Decoded { format, size: PictureSize { width, height } })
}

/// Refuses a picture whose first bytes already say that it cannot be taken. A
/// header that is not there to its end yet says nothing.
pub(super) fn check_start(start: &[u8], limits: &ImageLimits) -> Result<(), ImageError> {
    match picture::inspect(start, limits) {
        Err(ImageError::Damaged(_)) | Ok(_) => Ok(()),
        Err(error) => Err(error),
    }
}

/// Says what is wrong with the picture of `part`, and how to mend it.
pub(in crate::http) fn image_problem(part: &str, error: &ImageError) -> Problem {
    let (kind, mend) = match error {
        ImageError::TooManyBytes { .. } => (PART_TOO_LARGE, "compress it or scale it down"),
        ImageError::TooManyPixels { .. } => (TOO_MANY_PIXELS, "scale it down"),
        ImageError::NotAnImage => (NOT_AN_IMAGE, "export it as one of these"),
        ImageError::Inflates { .. } => (TOO_MANY_PIXELS, "export it again, as PNG"),
        ImageError::Damaged(_) => (DAMAGED_IMAGE, "export or copy it again"),
        // The error says itself what to send instead.
        ImageError::Unsupported { .. } => {
            return Problem::new(NOT_AN_IMAGE, format!("`{part}` {error}")).part(part);
        }
    };
    Problem::new(kind, format!("`{part}` {error}; {mend}")).part(part)
}
