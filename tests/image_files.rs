//! OpenEXR files: what is written is what is read, and what is damaged is an error.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use std::fs;
use std::path::Path;

use ndarray::{Array2, Array3};
use pathblend::image::{Image, ImageError, Layer, Precision, WriteOptions, layers_path};
use proptest::prelude::*;
use serde_json::json;

/// A small image with both kinds of layers, awkward values and a manifest beyond ASCII.
fn sample(width: usize, height: usize) -> Image {
    let mut image = Image::new(width, height);
    image.colour = Array3::from_shape_fn((height, width, 3), |(y, x, c)| {
        (x as f32 + 1.0).sqrt() * 0.3 - y as f32 * 0.07 + c as f32 * 100.0
    });
    image.colour[[0, 0, 0]] = f32::NAN;
    image.colour[[0, 0, 1]] = f32::INFINITY;
    image.colour[[0, 0, 2]] = -1e30;
    let field = Array2::from_shape_fn((height, width), |(y, x)| (y * 31 + x) as f32 / 7.0);
    let variance = Array3::from_shape_fn((height, width, 3), |(y, x, c)| (y + x + c) as f32);
    image.insert("path_LDSE", Layer::Luminance(field)).unwrap();
    image.insert("variance", Layer::Colour(variance)).unwrap();
    let manifest = json!({"z": "späť \"quoted\"\n", "a": [1, 2.5], "wall_s": 2.5, "samples_per_pixel": 64});
    image.manifest = manifest.as_object().unwrap().clone();
    image
}

/// Bit patterns, so that NaN equals itself: of the colour, and of each layer with its shape.
type Bits = (Vec<u32>, Vec<(String, Vec<usize>, Vec<u32>)>);

fn bits(image: &Image) -> Bits {
    let of = |samples: &mut dyn Iterator<Item = &f32>| samples.map(|s| s.to_bits()).collect();
    let layer = |(name, layer): (&String, &Layer)| {
        let samples = match layer {
            Layer::Luminance(s) => of(&mut s.iter()),
            Layer::Colour(s) => of(&mut s.iter()),
        };
        (name.clone(), layer.shape().to_vec(), samples)
    };
    (of(&mut image.colour.iter()), image.layers.iter().map(layer).collect())
}

fn assert_same(found: &Image, expected: &Image) {
    assert_eq!(found.colour.dim(), expected.colour.dim());
    assert_eq!(bits(found), bits(expected));
    assert_eq!(found.manifest, expected.manifest);
    let order = |image: &Image| image.manifest.keys().cloned().collect::<Vec<_>>();
    assert_eq!(order(found), order(expected));
}

#[test]
fn floats_come_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for (width, height) in [(1, 1), (37, 50), (1, 17), (300, 16)] {
        let image = sample(width, height);
        image.write(&path, &WriteOptions::default()).unwrap();
        assert_same(&Image::read(&path).unwrap(), &image);
    }
}

#[test]
fn halves_come_back_to_eleven_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let image = sample(20, 20);
    let options = WriteOptions { precision: Precision::Half, ..Default::default() };
    image.write(&path, &options).unwrap();
    let found = Image::read(&path).unwrap();
    assert!(found.colour[[0, 0, 0]].is_nan() && found.colour[[0, 0, 1]] == f32::INFINITY);
    assert_eq!(found.colour[[0, 0, 2]], -65504.0);
    for (index, &expected) in image.colour.indexed_iter().skip(3) {
        let error = (found.colour[index] - expected).abs();
        assert!(error <= expected.abs() / 2048.0 + 1e-7, "{index:?}");
    }
    assert_eq!(found.layers.len(), 2);
}

#[test]
fn the_file_has_one_part_and_names_that_tools_split_alike() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    sample(4, 3).write(&path, &WriteOptions::default()).unwrap();
    let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
    assert!(!meta.requirements.has_multiple_layers && meta.headers.len() == 1);
    let header = &meta.headers[0];
    let channels: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(channels, ["B", "G", "R", "path_LDSE.Y", "variance.B", "variance.G", "variance.R"]);
    assert_eq!(header.compression, exr::prelude::Compression::ZIP16);
    let attribute = |name: &str| &header.own_attributes.other[&exr::prelude::Text::from(name)];
    use exr::prelude::AttributeValue::{F32, I32, Text};
    assert_eq!(attribute("renderTimeSeconds"), &F32(2.5));
    assert_eq!(attribute("samplesPerPixel"), &I32(64));
    let Text(manifest) = attribute("pathblend") else { panic!("not a string") };
    let manifest: serde_json::Value = serde_json::from_slice(manifest.as_slice()).unwrap();
    assert_eq!(manifest["z"], "späť \"quoted\"\n");
}

#[test]
fn a_split_image_is_joined_again_while_both_files_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.v2.exr");
    let image = sample(9, 40);
    let options = WriteOptions { split: true, ..Default::default() };
    image.write(&path, &options).unwrap();
    let layers = folder.path().join("out.v2_layers.exr");
    assert_eq!(layers_path(&path), layers);
    assert_same(&Image::read(&path).unwrap(), &image);
    let alone = Image::read(&layers).unwrap_err();
    assert!(matches!(&alone, ImageError::NoColour { channels, .. } if channels.contains("path_LDSE.Y")));
    sample(8, 8).write(&layers, &options).unwrap();
    assert!(matches!(Image::read(&path), Err(ImageError::Damaged { path, .. }) if path == layers));
    fs::remove_file(&layers).unwrap();
    assert!(Image::read(&path).unwrap().layers.is_empty());
}

#[test]
fn a_bad_image_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let options = WriteOptions::default();
    assert!(matches!(Image::new(0, 4).write(&path, &options), Err(ImageError::Encode { .. })));
    let mut image = sample(4, 4);
    image.layers.insert("a.b".into(), Layer::Luminance(Array2::zeros((4, 4))));
    assert!(matches!(image.write(&path, &options), Err(ImageError::LayerName { .. })));
    let mut image = sample(4, 4);
    image.layers.insert("small".into(), Layer::Luminance(Array2::zeros((2, 2))));
    assert!(matches!(image.write(&path, &options), Err(ImageError::LayerShape { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn errors_name_the_file_and_what_was_expected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("odd.exr");
    let message = || Image::read(&path).unwrap_err().to_string();
    assert!(message().contains("cannot read") && message().contains("odd.exr"));
    fs::write(&path, "").unwrap();
    assert!(message().contains("odd.exr") && message().contains("an empty file"));
    fs::write(&path, b"\x89PNG\r\n").unwrap();
    assert!(message().contains("found 89 50 4e 47") && message().contains("76 2f 31 01"));
    let image = sample(5, 5);
    image.write(&path, &WriteOptions::default()).unwrap();
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
    assert!(message().contains("truncated") && message().contains("odd.exr"), "{}", message());
    assert!(Image::read(folder.path()).unwrap_err().to_string().contains("cannot read"));
}

/// Reads bytes as a file. The result does not matter; that there is one, without panic or abort, does.
fn read_bytes(folder: &Path, bytes: &[u8]) -> Result<Image, ImageError> {
    let path = folder.join("bytes.exr");
    fs::write(&path, bytes).unwrap();
    Image::read(&path)
}

/// Small files in every compression that the reader knows, tiled and not, by the `exr` crate itself.
fn foreign_files(folder: &Path) -> Vec<Vec<u8>> {
    use exr::prelude::*;
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::DWAA(None),
    ];
    let path = folder.join("foreign.exr");
    let mut files = Vec::new();
    for compression in compressions {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 16))] {
            let pixel = |p: Vec2<usize>| {
                let (x, y) = (p.x() as f32, p.y() as f32);
                (x * 0.1, f16::from_f32(y), (p.x() * p.y()) as u32, 1.0f32)
            };
            let channels = SpecificChannels::build()
                .with_channel::<f32>("R")
                .with_channel::<f16>("G")
                .with_channel::<u32>("B")
                .with_channel::<f32>("A")
                .with_pixel_fn(pixel);
            let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
            let layer = Layer::new((40, 33), LayerAttributes::named("main"), encoding, channels);
            Image::from_layer(layer).write().to_file(&path).unwrap();
            files.push(std::fs::read(&path).unwrap());
        }
    }
    files
}

#[test]
fn foreign_files_of_every_kind_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for (index, file) in foreign_files(folder.path()).iter().enumerate() {
        let image = read_bytes(folder.path(), file).unwrap();
        assert_eq!((image.width(), image.height(), image.layers.len()), (40, 33, 0));
        let pixel = |c| image.colour[[20, 30, c]];
        let near = |found: f32, expected: f32| (found - expected).abs() <= 0.02 * expected;
        assert!(near(pixel(0), 3.0) && near(pixel(1), 20.0), "file {index}");
        assert_eq!(pixel(2), 600.0, "file {index}");
    }
}

/// Two parts as some renderers write them: depth first, then the picture; and one part of grey alone.
#[test]
fn pictures_are_found_among_parts_and_in_grey() {
    use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, LayerAttributes, WritableImage};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.exr");
    let part = |name: &str, channels: &[(&str, f32)]| {
        let list = channels.iter().map(|&(name, value)| AnyChannel::new(name, FlatSamples::F32(vec![value; 6])));
        let channels = AnyChannels::sort(list.collect());
        let name = LayerAttributes::named(name);
        exr::prelude::Layer::new((3, 2), name, Encoding::UNCOMPRESSED, channels)
    };
    let depth = part("depth", &[("Z", 9.0)]);
    let picture = part("picture", &[("R", 1.0), ("G", 2.0), ("B", 3.0)]);
    let albedo = part("albedo", &[("R", 0.1), ("G", 0.2), ("B", 0.3), ("extra.Y", 7.0)]);
    let window = exr::prelude::ImageAttributes::with_size((3, 2));
    let file = exr::prelude::Image::from_layers(window, vec![depth, picture, albedo]);
    file.write().to_file(&path).unwrap();
    let found = Image::read(&path).unwrap();
    assert_eq!(found.colour, Array3::from_shape_fn((2, 3, 3), |(_, _, c)| c as f32 + 1.0));
    assert_eq!(found.layers.keys().collect::<Vec<_>>(), ["albedo", "extra"]);
    assert_eq!(found.layers["extra"], Layer::Luminance(Array2::from_elem((2, 3), 7.0)));
    let grey = part("grey", &[("A", 1.0), ("Y", 0.5)]);
    exr::prelude::Image::from_layer(grey).write().to_file(&path).unwrap();
    assert_eq!(Image::read(&path).unwrap().colour, Array3::from_elem((2, 3, 3), 0.5));
}

#[test]
fn every_truncation_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.exr");
    sample(30, 40).write(&path, &WriteOptions::default()).unwrap();
    let mut files = foreign_files(folder.path());
    files.push(fs::read(&path).unwrap());
    for (index, file) in files.iter().enumerate() {
        let steps = (0..600).chain((600..file.len()).step_by(file.len() / 100 + 1));
        for length in steps.chain([file.len() - 1]).filter(|&l| l < file.len()) {
            let result = read_bytes(folder.path(), &file[..length]);
            assert!(result.is_err(), "file {index} of {} cut at {length}", file.len());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn flipped_bytes_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        in_header in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        for mut file in foreign_files(folder.path()) {
            let range = if in_header { 500 } else { file.len() };
            for (index, value) in &flips {
                file[index.index(range)] = *value;
            }
            if let Ok(image) = read_bytes(folder.path(), &file) {
                prop_assert!(image.width() > 0 && image.height() > 0);
            }
        }
    }
}
