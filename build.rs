//! Watches the built web page, which the program holds inside of itself.

use std::fs;

fn main() {
    // Watched as a folder, so that the program is built anew when the page is
    // built for the first time too. Without Node it stays empty.
    let folder = "web/dist";
    if let Err(error) = fs::create_dir_all(folder) {
        println!("cargo::warning={folder} cannot be made: {error}");
    }
    println!("cargo::rerun-if-changed={folder}");
}
