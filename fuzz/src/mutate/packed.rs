//! What is compressed, out of its wrap and into it again.

use std::io::Read;

use flate2::read::{DeflateDecoder, ZlibEncoder};
use flate2::{Compression, Decompress, FlushDecompress};

/// More than this is no small file.
const CONTENT_BYTES_MAX: u64 = 1 << 20;

/// What a stream of zlib holds, whatever its checksum says; `None` if nothing can be read.
#[must_use]
pub fn unzlib(stream: &[u8]) -> Option<Vec<u8>> {
    inflated(stream.get(2..)?)
}

/// What a stream of deflate holds, as far as it can be read; `None` if nothing can.
#[must_use]
pub fn inflated(stream: &[u8]) -> Option<Vec<u8>> {
    let mut content = Vec::new();
    // What was read before a fault stays in `content`.
    let _ = DeflateDecoder::new(stream).take(CONTENT_BYTES_MAX).read_to_end(&mut content);
    (!content.is_empty()).then_some(content)
}

/// A stream of zlib that holds `content`.
#[must_use]
pub fn zlib(content: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    let packed = ZlibEncoder::new(content, Compression::fast()).read_to_end(&mut stream);
    packed.expect("memory is read and written");
    stream
}

/// Makes right the checksum at the end of a stream of zlib that can be read.
pub fn mend_zlib(stream: &mut [u8]) {
    let mut inflater = Decompress::new(false);
    let mut content = Vec::with_capacity(CONTENT_BYTES_MAX as usize);
    let Some(deflated) = stream.get(2..) else { return };
    if inflater.decompress_vec(deflated, &mut content, FlushDecompress::Finish).is_ok() {
        let end = 2 + inflater.total_in() as usize;
        if let Some(sum) = stream.get_mut(end..end + 4) {
            sum.copy_from_slice(&adler32(&content).to_be_bytes());
        }
    }
}

fn adler32(content: &[u8]) -> u32 {
    let (mut a, mut b) = (1_u32, 0_u32);
    for &byte in content {
        a = (a + u32::from(byte)) % 65_521;
        b = (b + a) % 65_521;
    }
    b << 16 | a
}
