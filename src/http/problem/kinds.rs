//! Every kind of problem that the service answers with.

use axum::http::StatusCode;

/// A kind of problem, served as a page at `/problems/{name}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProblemType {
    /// Stable name in the type's URI, such as `not-an-image`.
    pub name: &'static str,
    /// HTTP status of the answer.
    pub status: StatusCode,
    /// What it is, in one line.
    pub title: &'static str,
    /// What it means and how to mend it, for the page.
    pub about: &'static str,
}

macro_rules! problem_types {
    ($($id:ident = $status:ident $name:literal, $title:literal, $about:literal;)*) => {
        $(pub(crate) const $id: ProblemType = ProblemType {
            name: $name,
            status: StatusCode::$status,
            title: $title,
            about: $about,
        };)*

        /// Every kind, in the order of the documentation.
        pub(crate) const ALL: &[ProblemType] = &[$($id),*];
    };
}

problem_types! {
    UNSUPPORTED_MEDIA_TYPE = UNSUPPORTED_MEDIA_TYPE "unsupported-media-type",
        "The request's media type is not supported",
        "Send uploads as multipart/form-data, as curl -F does, and let the client write the boundary.";
    MALFORMED_MULTIPART = BAD_REQUEST "malformed-multipart",
        "The multipart body is malformed",
        "The body ended early or its parts and boundaries do not fit RFC 7578. Send it again with a client that writes multipart/form-data itself.";
    INVALID_PART_NAME = BAD_REQUEST "invalid-part-name",
        "A part has no usable name",
        "Every part needs a Content-Disposition with a name in UTF-8 of at most 200 bytes, such as view[45].";
    BODY_TOO_LARGE = PAYLOAD_TOO_LARGE "body-too-large",
        "The request body is too large",
        "The whole upload is over the limit. Send smaller pictures or fewer of them.";
    PART_TOO_LARGE = PAYLOAD_TOO_LARGE "part-too-large",
        "A part has too many bytes",
        "One picture or document is over the limit of its kind. Compress or shrink it.";
    TOO_MANY_PIXELS = PAYLOAD_TOO_LARGE "too-many-pixels",
        "A picture has too many pixels",
        "The size in the picture's header is over the limit; no pixel was decoded. Scale the picture down.";
    TOO_MANY_VIEWS = UNPROCESSABLE_ENTITY "too-many-views",
        "There are too many views",
        "The sheet has more views than one job takes. Leave some out.";
    TOO_FEW_VIEWS = UNPROCESSABLE_ENTITY "too-few-views",
        "There are fewer level views than the method takes",
        "Add level views, or choose a method that takes fewer. Views from above and below do not count.";
    MISSING_PART = UNPROCESSABLE_ENTITY "missing-part",
        "A part is missing",
        "Send the drawings as parts view[AZIMUTH], or a part page with all of them, or a part sheet with the files it names, or a part source with the id of an earlier reconstruction. A sheet to be drawn needs a part model.";
    UNKNOWN_PART = UNPROCESSABLE_ENTITY "unknown-part",
        "A part is not known",
        "Parts are view[AZIMUTH] or view[AZIMUTH,ELEVATION], mask and truth likewise, truth, truth_model, sheet, image, mask, page, azimuths, options, source and single options by their dotted names; of a sheet to be drawn, model, azimuths, up_axis and options. A file in the sheet form must be named by the sheet document.";
    DUPLICATE_PART = UNPROCESSABLE_ENTITY "duplicate-part",
        "A part is given twice",
        "Give every part, every option and every file name once.";
    CONFLICTING_PARTS = UNPROCESSABLE_ENTITY "conflicting-parts",
        "Parts of different upload forms are mixed",
        "Use one form: view[AZIMUTH] parts, or a page, or a sheet document with its files, or a source.";
    MISSING_FILE = UNPROCESSABLE_ENTITY "missing-file",
        "The sheet names a file that was not sent",
        "Send a part with that file name for every picture that the sheet document names.";
    NOT_FETCHED = UNPROCESSABLE_ENTITY "not-fetched",
        "A file that is named by URL could not be fetched",
        "The URL must be https, of a host with a public address, and answer 200 with the file within ten seconds, without redirects. Or send the file itself.";
    DUPLICATE_AZIMUTH = UNPROCESSABLE_ENTITY "duplicate-azimuth",
        "Two views look along the same direction",
        "Give each azimuth and elevation once. Azimuths a full turn apart are the same: 360 and 0, or -45 and 315. Straight from above or below, at elevation 90 or -90, all azimuths are: they only turn the picture.";
    ELEVATED_VIEW = UNPROCESSABLE_ENTITY "elevated-view",
        "A view is drawn from above or below, and the method takes level views",
        "Leave the view out, or use the method turntable.";
    INVALID_ANGLE = UNPROCESSABLE_ENTITY "invalid-angle",
        "An angle is not a finite number of degrees",
        "Write angles as decimal degrees, such as view[22.5], or with an elevation from -90 to 90 view[22.5,30].";
    DIFFERING_SIZES = UNPROCESSABLE_ENTITY "differing-sizes",
        "The pictures' sizes differ",
        "The method takes views of one width and height, and a mask or a picture of true values has the size of its drawing. Pad or scale the pictures.";
    EMPTY_FILE = UNPROCESSABLE_ENTITY "empty-file",
        "A file is empty",
        "The part has no bytes. Check the path that the client read the file from.";
    NO_FIGURE = UNPROCESSABLE_ENTITY "no-figure",
        "No figure was found on the page",
        "Nothing on the page looks like a whole figure: it is blank, or all that is drawn on it are lettering, lines and small details. Send the views one by one as parts view[AZIMUTH].";
    WRONG_NUMBER_OF_FIGURES = UNPROCESSABLE_ENTITY "wrong-number-of-figures",
        "The page has another number of figures than there are azimuths",
        "The problem's detail lists the figures that were found. Give one azimuth for each in that order, write auto, or send the views one by one as parts view[AZIMUTH].";
    INVALID_PAGE = UNPROCESSABLE_ENTITY "invalid-page",
        "The edited page is not valid",
        "A key is unknown or missing, a box lies outside of its picture, or a mask is of no figure. Get the page, change what is to be put right in its document, and send that back.";
    NOT_AN_IMAGE = UNPROCESSABLE_ENTITY "not-an-image",
        "A file is not an image",
        "Drawings and masks are PNG, JPEG, WebP, TIFF, GIF or SVG files with one picture each; the file's first bytes decide, not its name.";
    DAMAGED_IMAGE = UNPROCESSABLE_ENTITY "damaged-image",
        "An image is damaged or truncated",
        "The file starts like an image but cannot be decoded to its end. Export it again.";
    INVALID_TRUTH = UNPROCESSABLE_ENTITY "invalid-truth",
        "A file of the ground truth cannot be used",
        "True values are PNG (8 or 16 bits), PFM or EXR pictures with at least one value; 0 is background in a PNG. The true model is an OBJ, PLY, STL, GLB or glTF file and needs the sheet's pixels_per_unit.";
    INVALID_JSON = BAD_REQUEST "invalid-json",
        "A part is not valid JSON",
        "The parts sheet, options and truth are JSON documents (RFC 8259) in UTF-8. NaN and Infinity are not JSON.";
    INVALID_SHEET = UNPROCESSABLE_ENTITY "invalid-sheet",
        "The sheet document is not valid",
        "A key is unknown or missing, or a value has the wrong type or range. The API description has the document's schema.";
    UNKNOWN_OPTION = UNPROCESSABLE_ENTITY "unknown-option",
        "An option is not known",
        "/v1/options lists every option of a reconstruction with its type, range, unit, default and meaning; /v1/sheet-options those of a sheet to be drawn.";
    INVALID_OPTION = UNPROCESSABLE_ENTITY "invalid-option",
        "An option's value is not accepted",
        "The value has the wrong type, is out of range, or does not go with another option. /v1/options and /v1/sheet-options have the ranges.";
    UNKNOWN_SOURCE = UNPROCESSABLE_ENTITY "unknown-source",
        "There is nothing to take the views from",
        "The part source must be the id of a reconstruction that has not been deleted, a part page without a file name that of a page.";
    UNKNOWN_MODEL = UNPROCESSABLE_ENTITY "unknown-model",
        "There is no such built-in model",
        "The part model is a file, or builtin:NAME with the name of a built-in model. The problem's detail lists them.";
    UNKNOWN_MODEL_FORMAT = UNPROCESSABLE_ENTITY "unknown-model-format",
        "The model's format is not known",
        "The format is told by the file's name, which must end in .glb, .gltf, .obj, .ply or .stl. Send the model as a file, as curl -F 'model=@NAME.glb' does.";
    INVALID_MODEL = UNPROCESSABLE_ENTITY "invalid-model",
        "The model cannot be read",
        "The file is damaged, not of the format that its name says, has coordinates that are not finite, or no triangle with an area. Export it again.";
    UNSUPPORTED_MODEL = UNPROCESSABLE_ENTITY "unsupported-model",
        "The model needs a feature that is not supported",
        "The file uses an extension or an encoding that is not read. Export it without, or in another format.";
    EXTERNAL_REFERENCE = UNPROCESSABLE_ENTITY "external-reference",
        "The model refers to other files",
        "Only what the file itself holds is read. Export it as GLB, or as glTF with embedded buffers.";
    MODEL_TOO_LARGE = PAYLOAD_TOO_LARGE "model-too-large",
        "The model has too many triangles or vertices",
        "The model is over the limit of this service. Decimate it.";
    CAMERA_INSIDE_MODEL = UNPROCESSABLE_ENTITY "camera-inside-model",
        "The model reaches behind the camera",
        "Scale the model, move the camera back with the option distance, or let the model be fitted with the option fit.";
    SHEET_TOO_LARGE = UNPROCESSABLE_ENTITY "sheet-too-large",
        "The sheet that is asked for is too large",
        "Ask for fewer views, smaller ones, or less supersampling.";
    JOB_TOO_LARGE = UNPROCESSABLE_ENTITY "job-too-large",
        "The job would need more memory than it may take",
        "Views and options together need more memory than this service has for one job. Use smaller views, fewer disparities, or another mode or detector.";
    UNAUTHORIZED = UNAUTHORIZED "unauthorized",
        "A key is needed",
        "Send a key as `Authorization: Bearer KEY`. Who runs the service makes keys, with `turnaround keys create`.";
    INSUFFICIENT_SCOPE = FORBIDDEN "insufficient-scope",
        "The key does not allow this",
        "Keys of the scope read look, those of write upload, cancel and delete too, and those of admin make tenants and keys.";
    TOO_MANY_REQUESTS = TOO_MANY_REQUESTS "too-many-requests",
        "Too many requests",
        "The tenant has used up its requests of this second, or its open streams. Go on after the time in Retry-After; to wait for a job, ask with Prefer: wait=N.";
    TOO_MANY_JOBS = TOO_MANY_REQUESTS "too-many-jobs",
        "Too many jobs wait already",
        "As many jobs of the tenant wait as may. Send more when some have run, or cancel those not needed.";
    INVALID_IDEMPOTENCY_KEY = BAD_REQUEST "invalid-idempotency-key",
        "The Idempotency-Key cannot be read",
        "Send one string of 1 to 255 visible characters, such as a new UUID for each upload.";
    IDEMPOTENCY_KEY_REUSED = UNPROCESSABLE_ENTITY "idempotency-key-reused",
        "The Idempotency-Key came with another upload",
        "Within a day a key stands for one upload. Use a new key for each, and the same only to send the same again.";
    IDEMPOTENT_JOB_GONE = CONFLICT "idempotent-job-gone",
        "The job that this Idempotency-Key became is deleted",
        "The upload was taken before, and its job deleted since. Use a new key to have it made again.";
    INVALID_WEBHOOK = UNPROCESSABLE_ENTITY "invalid-webhook",
        "The webhook's address is refused",
        "Give an https URL of a host with a public address, without a name and password. Who runs the service can let other hosts be called with --trusted-host, and http with --allow-http.";
    NO_WEBHOOK_SECRET = CONFLICT "no-webhook-secret",
        "There is no secret to sign messages with",
        "Make one with POST /v1/webhook/secret and give it to the receiver; then name addresses.";
    UNKNOWN_DELIVERY = NOT_FOUND "unknown-delivery",
        "There is no such message",
        "The job's list of deliveries has the ids of all messages about it.";
    INVALID_BODY = UNPROCESSABLE_ENTITY "invalid-body",
        "The body is not what the operation takes",
        "Send JSON as application/json, as the API description has it.";
    UNKNOWN_TENANT = NOT_FOUND "unknown-tenant",
        "There is no such tenant",
        "/v1/admin/tenants lists those there are.";
    TENANT_EXISTS = CONFLICT "tenant-exists",
        "There is such a tenant already",
        "Choose another name, or use the tenant that is there.";
    TENANT_IN_USE = CONFLICT "tenant-in-use",
        "The tenant cannot be deleted",
        "A job of it runs: cancel it and wait. The tenant default stays for ever.";
    UNKNOWN_KEY = NOT_FOUND "unknown-key",
        "There is no such key",
        "/v1/admin/keys lists those there are.";
    HEADER_TOO_LARGE = REQUEST_HEADER_FIELDS_TOO_LARGE "header-too-large",
        "The request's header is too long",
        "Send fewer or shorter header fields.";
    MISDIRECTED_REQUEST = MISDIRECTED_REQUEST "misdirected-request",
        "The service is not called by this name",
        "The Host header names another service. Call this one by its own name; who runs it allows names with --allowed-host.";
    FOREIGN_ORIGIN = FORBIDDEN "foreign-origin",
        "A page of another origin may change nothing",
        "A browser sent this for a web page that is not of this service. Send a key with it, or have the page's origin allowed with --cors-origin.";
    INVALID_QUERY = BAD_REQUEST "invalid-query",
        "A query parameter is not valid",
        "A parameter is unknown or its value cannot be read. The API description lists what each operation takes.";
    NOT_FOUND = NOT_FOUND "not-found",
        "There is nothing at this path",
        "Check the path against the API description at /docs.";
    UNKNOWN_RECONSTRUCTION = NOT_FOUND "unknown-reconstruction",
        "There is no such reconstruction",
        "It was deleted or never existed. /v1/reconstructions lists those there are.";
    UNKNOWN_PAGE = NOT_FOUND "unknown-page",
        "There is no such page, or no such file of it",
        "It was deleted or never existed, or its document names no such file.";
    UNKNOWN_SHEET = NOT_FOUND "unknown-sheet",
        "There is no such sheet",
        "It was deleted or never existed. /v1/sheets lists those there are.";
    UNKNOWN_ARTIFACT = NOT_FOUND "unknown-artifact",
        "There is no such artifact",
        "Artifacts exist once a job has succeeded; which of them depends on the method. Its list of artifacts has their names.";
    INVALID_LINK = NOT_FOUND "invalid-link",
        "The link does not open anything",
        "It has ended, or it is not as it was made. Who has a key can make a new one.";
    METHOD_NOT_ALLOWED = METHOD_NOT_ALLOWED "method-not-allowed",
        "The method is not allowed here",
        "The Allow header lists the methods of this resource.";
    ALREADY_FINISHED = CONFLICT "already-finished",
        "The job is finished already",
        "Only queued and running jobs can be cancelled.";
    STILL_RUNNING = CONFLICT "still-running",
        "The job is running",
        "Cancel it first, wait until it has stopped, then delete it.";
    PRECONDITION_FAILED = PRECONDITION_FAILED "precondition-failed",
        "A precondition does not hold",
        "The If-Match header names another version of the resource. Get it again.";
    RANGE_NOT_SATISFIABLE = RANGE_NOT_SATISFIABLE "range-not-satisfiable",
        "The range lies outside the artifact",
        "The Content-Range header has the artifact's length in bytes.";
    REQUEST_TIMEOUT = REQUEST_TIMEOUT "request-timeout",
        "The request took too long to arrive",
        "The client stopped sending, or sent too slowly. Send the request again.";
    BUSY = SERVICE_UNAVAILABLE "busy",
        "The service is busy",
        "Too many uploads are being received, or the answer took too long. Try again after the time in Retry-After.";
    UNAVAILABLE = SERVICE_UNAVAILABLE "unavailable",
        "The service cannot answer now",
        "Its database or store cannot be reached, or it is shutting down. Try again after the time in Retry-After.";
    INSUFFICIENT_STORAGE = INSUFFICIENT_STORAGE "insufficient-storage",
        "There is no room left",
        "The service's disk, or what it may use of it, is full but for what it needs to go on. Deleting jobs and pages makes room, and is always possible.";
    TENANT_FULL = INSUFFICIENT_STORAGE "tenant-full",
        "The tenant stores as much as it may",
        "Delete jobs and pages that are not needed, or let them go by themselves with expires_in. Who runs the service sets the limit.";
    INTERNAL = INTERNAL_SERVER_ERROR "internal",
        "Something went wrong inside the service",
        "This is a fault of the service. Its log has the cause under the id in the X-Request-Id header.";
    BAD_REQUEST = BAD_REQUEST "bad-request",
        "The request cannot be understood",
        "A header or the path is malformed.";
}

impl ProblemType {
    /// The kind with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        ALL.iter().find(|kind| kind.name == name)
    }

    /// The kind for an error that only has a status.
    pub(super) fn of_status(status: StatusCode) -> Self {
        match status {
            StatusCode::NOT_FOUND => NOT_FOUND,
            StatusCode::UNAUTHORIZED => UNAUTHORIZED,
            StatusCode::TOO_MANY_REQUESTS => TOO_MANY_REQUESTS,
            StatusCode::METHOD_NOT_ALLOWED => METHOD_NOT_ALLOWED,
            StatusCode::PAYLOAD_TOO_LARGE => BODY_TOO_LARGE,
            StatusCode::UNSUPPORTED_MEDIA_TYPE => UNSUPPORTED_MEDIA_TYPE,
            StatusCode::REQUEST_TIMEOUT => REQUEST_TIMEOUT,
            StatusCode::SERVICE_UNAVAILABLE => BUSY,
            StatusCode::INSUFFICIENT_STORAGE => INSUFFICIENT_STORAGE,
            status if status.is_server_error() => INTERNAL,
            _ => BAD_REQUEST,
        }
    }

    /// The relative URI of the kind's page.
    pub fn uri(&self) -> String {
        format!("/problems/{}", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_fit_a_path() {
        let mut names: Vec<_> = ALL.iter().map(|kind| kind.name).collect();
        assert!(names.iter().all(|n| n.bytes().all(|b| b.is_ascii_lowercase() || b == b'-')));
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
    }
}
