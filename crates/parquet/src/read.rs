//! Rows of such files, and of others whose columns lie in them as plainly.

use crate::thrift::{BINARY, Fields, I32, I64, LIST, STRUCT};
use crate::{BLOCK, DATA_PAGE, DOUBLE, MARK, PLAIN, REQUIRED, UNCOMPRESSED};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes of the longest header of a page that is looked at.
const LONGEST_HEADER: u64 = 1 << 10;
/// Bytes behind the footer: its length and the mark.
const TAIL: u64 = 8;
/// Bytes of a value.
const SIZE: usize = size_of::<f64>();

/// A column of one group of rows.
#[derive(Default)]
struct Chunk {
    name: Vec<u8>,
    kind: i64,
    codec: i64,
    rows: usize,
    page: u64,
    has_dictionary: bool,
}

/// A Parquet file whose columns are plain.
pub struct Plain {
    file: File,
    chunks: Vec<Chunk>,
    optional: Vec<Vec<u8>>,
}

impl Plain {
    /// Opens a file; none where its footer is not understood.
    ///
    /// # Errors
    /// What the file says.
    pub fn open(path: &Path) -> io::Result<Option<Self>> {
        let mut file = File::open(path)?;
        let size = file.metadata()?.len();
        let Some(end) = size.checked_sub(TAIL) else { return Ok(None) };
        file.seek(SeekFrom::Start(end))?;
        let (mut length, mut mark) = ([0; 4], [0; MARK.len()]);
        file.read_exact(&mut length)?;
        file.read_exact(&mut mark)?;
        let length = u32::from_le_bytes(length);
        let Some(begin) = end.checked_sub(u64::from(length)).filter(|_| mark == *MARK) else {
            return Ok(None);
        };
        file.seek(SeekFrom::Start(begin))?;
        let mut footer = vec![0; length as usize];
        file.read_exact(&mut footer)?;
        let Some((optional, chunks)) = understood(&footer) else { return Ok(None) };
        Ok(Some(Plain { file, chunks, optional }))
    }

    /// The values of a column from row `begin` to before row `end`, or to the last one; none where it is not plain.
    ///
    /// # Errors
    /// What the file says.
    pub fn read(&mut self, name: &str, begin: usize, end: usize) -> io::Result<Option<Vec<f64>>> {
        let own = |chunk: &&Chunk| chunk.name == name.as_bytes();
        let is_optional = self.optional.iter().any(|optional| optional == name.as_bytes());
        let rows = self.chunks.iter().filter(own).try_fold(0_usize, |sum, chunk| sum.checked_add(chunk.rows));
        // A footer may say anything: no more rows are believed than the file has room for.
        let most = usize::try_from(self.file.metadata()?.len()).unwrap_or(usize::MAX) / SIZE;
        let Some(rows) = rows.filter(|rows| *rows <= most) else { return Ok(None) };
        if is_optional || rows == 0 {
            return Ok(None);
        }
        let end = end.min(rows);
        let (mut values, mut first) = (Vec::with_capacity(end.saturating_sub(begin)), 0);
        for chunk in self.chunks.iter().filter(own) {
            let (from, until) = (begin.max(first), end.min(first + chunk.rows));
            if from < until {
                let Some(place) = place_of_values(&mut self.file, chunk)? else { return Ok(None) };
                self.file.seek(SeekFrom::Start(place + (SIZE * (from - first)) as u64))?;
                take(&mut self.file, until - from, &mut values)?;
            }
            first += chunk.rows;
        }
        Ok(Some(values))
    }
}

/// Adds so many values.
fn take(file: &mut File, mut count: usize, values: &mut Vec<f64>) -> io::Result<()> {
    let mut bytes = vec![0; SIZE * BLOCK.min(count)];
    while count > 0 {
        let some = count.min(BLOCK);
        let bytes = &mut bytes[..SIZE * some];
        file.read_exact(bytes)?;
        let (each, _) = bytes.as_chunks::<SIZE>();
        values.extend(each.iter().map(|bytes| f64::from_le_bytes(*bytes)));
        count -= some;
    }
    Ok(())
}

/// Where the values of a column of a group begin, if they are plain and in one page.
fn place_of_values(file: &mut File, chunk: &Chunk) -> io::Result<Option<u64>> {
    if chunk.has_dictionary || (chunk.kind, chunk.codec) != (i64::from(DOUBLE), i64::from(UNCOMPRESSED)) {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(chunk.page))?;
    let mut header = Vec::new();
    file.take(LONGEST_HEADER).read_to_end(&mut header)?;
    let (mut kind, mut size, mut values, mut encoding) = (-1, -1, -1, -1);
    let mut fields = Fields::of(&header);
    let whole = fields.each(|number, field, from| {
        match (number, field) {
            (1, I32) => kind = from.int()?,
            (3, I32) => size = from.int()?,
            (5, STRUCT) => from.each(|number, field, from| {
                match (number, field) {
                    (1, I32) => values = from.int()?,
                    (2, I32) => encoding = from.int()?,
                    _ => from.skip(field)?,
                }
                Some(())
            })?,
            _ => from.skip(field)?,
        }
        Some(())
    });
    let rows = chunk.rows as i64;
    let is_plain = kind == i64::from(DATA_PAGE) && encoding == i64::from(PLAIN);
    let is_whole = values == rows && rows.checked_mul(SIZE as i64) == Some(size);
    let length = (header.len() - fields.left()) as u64;
    Ok((whole.is_some() && is_plain && is_whole).then_some(chunk.page + length))
}

/// The columns that may lack values, and the columns of all groups.
fn understood(footer: &[u8]) -> Option<(Vec<Vec<u8>>, Vec<Chunk>)> {
    let (mut optional, mut chunks) = (Vec::new(), Vec::new());
    Fields::of(footer).each(|number, field, from| {
        match (number, field) {
            (2, LIST) => from.items(|from| {
                let (mut name, mut repetition) = (Vec::new(), i64::from(REQUIRED));
                from.each(|number, field, from| {
                    match (number, field) {
                        (3, I32) => repetition = from.int()?,
                        (4, BINARY) => name = from.binary()?.to_vec(),
                        _ => from.skip(field)?,
                    }
                    Some(())
                })?;
                if repetition != i64::from(REQUIRED) {
                    optional.push(name);
                }
                Some(())
            })?,
            (4, LIST) => from.items(|from| {
                from.each(|number, field, from| match (number, field) {
                    (1, LIST) => from.items(|from| {
                        chunks.push(chunk(from)?);
                        Some(())
                    }),
                    _ => from.skip(field),
                })
            })?,
            _ => from.skip(field)?,
        }
        Some(())
    })?;
    Some((optional, chunks))
}

/// What a footer says of a column of a group.
fn chunk(from: &mut Fields<'_>) -> Option<Chunk> {
    let mut chunk = Chunk::default();
    let mut has_name = false;
    from.each(|number, field, from| match (number, field) {
        (3, STRUCT) => from.each(|number, field, from| {
            match (number, field) {
                (1, I32) => chunk.kind = from.int()?,
                (3, LIST) => from.items(|from| {
                    // A column within another one has several names, and no single one is that.
                    if has_name {
                        chunk.name.push(0);
                    }
                    chunk.name.extend_from_slice(from.binary()?);
                    has_name = true;
                    Some(())
                })?,
                (4, I32) => chunk.codec = from.int()?,
                (5, I64) => chunk.rows = usize::try_from(from.int()?).ok()?,
                (9, I64) => chunk.page = u64::try_from(from.int()?).ok()?,
                (11, I64) => {
                    chunk.has_dictionary = true;
                    from.skip(field)?;
                }
                _ => from.skip(field)?,
            }
            Some(())
        }),
        _ => from.skip(field),
    })?;
    Some(chunk)
}
