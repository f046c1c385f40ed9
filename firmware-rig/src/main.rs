//! The flash image. On the host this is an empty program: build the image with `cargo xtask image`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this is a firmware image: build it with `cargo xtask image`");
}
