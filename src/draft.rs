//! The main job: a sheet document and its image bytes in, artifacts out.
