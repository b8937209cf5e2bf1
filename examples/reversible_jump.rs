//! The paper's proof of reversible jumps in one dimension (Bitterli et al. 2017, section 7.1, figure 3):
//! `cargo run --release --example reversible_jump -- figure.png`.
//!
//! Prints how far each chain strays from the target, and draws histograms: above of x, below of the techniques as shares of
//! the states in each bin. Lines are what they should be. From left to right: multiplexed, jumps without Jacobian, jumps to
//! fixed points, jumps as they should be.

#[path = "one_dimension/mod.rs"]
mod one_dimension;

use image::{Rgb, RgbImage};
use one_dimension::{BINS, Bin, CHAINS, Histograms, run};

/// Width and height of one histogram in pixels, and space around it.
const SIZE: [u32; 2] = [256, 160];
const GAP: u32 = 16;

/// Colours of the techniques; the first also of the states.
const COLOURS: [[u8; 3]; 3] = [[86, 130, 190], [232, 152, 60], [96, 168, 104]];
const LINE: Rgb<u8> = Rgb([30, 30, 30]);

/// A histogram's corner.
fn corner(column: u32, row: u32) -> [u32; 2] {
    [GAP + column * (SIZE[0] + GAP), GAP + row * (SIZE[1] + GAP)]
}

/// Fills the bars between two heights, as shares of the histogram, bin by bin.
fn bars(picture: &mut RgbImage, [left, top]: [u32; 2], colour: [u8; 3], span: impl Fn(usize) -> [f64; 2]) {
    for x in 0..SIZE[0] {
        let heights = span((x as usize * BINS) / SIZE[0] as usize).map(|share| share.clamp(0.0, 1.0));
        let [low, high] = heights.map(|share| (share * f64::from(SIZE[1])) as u32);
        (low..high).for_each(|y| picture.put_pixel(left + x, top + SIZE[1] - 1 - y, Rgb(colour)));
    }
}

/// Draws a line through heights, bin by bin.
fn line(picture: &mut RgbImage, [left, top]: [u32; 2], height: impl Fn(usize) -> f64) {
    for x in 0..SIZE[0] {
        let share = height((x as usize * BINS) / SIZE[0] as usize).clamp(0.0, 0.999);
        let y = top + SIZE[1] - 1 - (share * f64::from(SIZE[1])) as u32;
        picture.put_pixel(left + x, y, LINE);
        picture.put_pixel(left + x, (y + 1).min(top + SIZE[1] - 1), LINE);
    }
}

fn draw(picture: &mut RgbImage, column: u32, found: &Histograms) {
    // The target has a maximum of 1.9.
    let scale = BINS as f64 / 2.2;
    let above = corner(column, 0);
    bars(picture, above, COLOURS[0], |bin| [0.0, found.states[bin].share * scale]);
    line(picture, above, |bin| found.states[bin].expected * scale);
    let below = corner(column, 1);
    let sum = |bin: usize, upto: usize, value: fn(&Bin) -> f64| -> f64 {
        found.techniques[..upto].iter().map(|bins| value(&bins[bin])).sum()
    };
    for (technique, colour) in COLOURS.into_iter().enumerate() {
        let share = |bin: usize, upto: usize| sum(bin, upto, |bin| bin.share) / sum(bin, 3, |bin| bin.share);
        bars(picture, below, colour, |bin| [share(bin, technique), share(bin, technique + 1)]);
    }
    for upto in [1, 2] {
        line(picture, below, |bin| sum(bin, upto, |bin| bin.expected) / sum(bin, 3, |bin| bin.expected));
    }
}

fn main() -> Result<(), image::ImageError> {
    let size = [4 * (SIZE[0] + GAP) + GAP, 2 * (SIZE[1] + GAP) + GAP];
    let mut picture = RgbImage::from_pixel(size[0], size[1], Rgb([255; 3]));
    println!("| chain | states: worst z | techniques: worst z |\n|---|---|---|");
    for (column, chain) in CHAINS.into_iter().enumerate() {
        let found = run(chain, 1);
        let [states, techniques] = found.worst();
        println!("| {chain:?} | {states:.1} | {techniques:.1} |");
        draw(&mut picture, column as u32, &found);
    }
    match std::env::args().nth(1) {
        Some(file) => picture.save(file),
        None => Ok(()),
    }
}
