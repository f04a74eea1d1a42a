//! Results as files: pictures, clouds, meshes and reports in standard formats.
