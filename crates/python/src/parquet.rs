//! Writer of Parquet files of 64-bit floats, plain and uncompressed, in groups of rows.
//!
//! Format: <https://parquet.apache.org/docs/file-format/>. polars reads the files, but its import takes
//! longer than a short command. Commands therefore write trajectories without polars.

use std::io::{self, Write};

/// Rows of a group.
const ROWS_OF_A_GROUP: usize = 1 << 18;

const MARK: &[u8; 4] = b"PAR1";
const DOUBLE: i32 = 5;
const REQUIRED: i32 = 0;
const PLAIN: i32 = 0;
const RUN_LENGTHS: i32 = 3; // of levels, of which there are none: each value is there
const UNCOMPRESSED: i32 = 0;
const DATA_PAGE: i32 = 0;
const BLOCK: usize = 1 << 13; // values that are turned into bytes at a time

/// A column with its name.
type Column<'a> = (&'a str, &'a [f64]);

/// One column of a group in the file.
struct Chunk<'a> {
    name: &'a str,
    begin: usize,
    size: usize,
    rows: usize,
    ends: Option<[f64; 2]>,
}

/// Writes columns of one length, and texts by key, as a Parquet file.
pub fn write(to: &mut impl Write, columns: &[Column<'_>], texts: &[(&str, &str)]) -> io::Result<()> {
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    assert!(columns.iter().all(|(_, values)| values.len() == rows), "columns of a table have one length");
    to.write_all(MARK)?;
    let mut at = MARK.len();
    let mut groups = Vec::new();
    for begin in (0..rows).step_by(ROWS_OF_A_GROUP) {
        let end = rows.min(begin + ROWS_OF_A_GROUP);
        let mut group = Vec::with_capacity(columns.len());
        for (name, values) in columns {
            let values = &values[begin..end];
            let size = page(to, values)?;
            group.push(Chunk { name, begin: at, size, rows: values.len(), ends: ends(values) });
            at += size;
        }
        groups.push(group);
    }
    let footer = footer(columns, rows, &groups, texts);
    to.write_all(&footer)?;
    to.write_all(&(footer.len() as u32).to_le_bytes())?;
    to.write_all(MARK)
}

/// Writes one page of values with its header, and returns its number of bytes.
fn page(to: &mut impl Write, values: &[f64]) -> io::Result<usize> {
    let size = size_of_val(values);
    let mut header = Vec::with_capacity(32);
    Struct::write(&mut header, |page| {
        page.int(1, DATA_PAGE);
        page.int(2, size as i32);
        page.int(3, size as i32);
        page.inner(5, |data| {
            data.int(1, values.len() as i32);
            data.int(2, PLAIN);
            data.int(3, RUN_LENGTHS);
            data.int(4, RUN_LENGTHS);
        });
    });
    to.write_all(&header)?;
    let mut bytes = Vec::with_capacity(size_of::<f64>() * BLOCK.min(values.len()));
    for block in values.chunks(BLOCK) {
        bytes.clear();
        bytes.extend(block.iter().flat_map(|value| value.to_le_bytes()));
        to.write_all(&bytes)?;
    }
    Ok(header.len() + size)
}

/// Returns the least and the greatest value, or `None` if a value is NaN. The format requires -0 for a least
/// zero and +0 for a greatest zero.
fn ends(values: &[f64]) -> Option<[f64; 2]> {
    let (mut least, mut greatest, mut is_number) = (f64::INFINITY, f64::NEG_INFINITY, true);
    for &value in values {
        is_number &= !value.is_nan();
        least = if value < least { value } else { least };
        greatest = if value > greatest { value } else { greatest };
    }
    is_number
        .then_some([if least == 0.0 { -0.0 } else { least }, if greatest == 0.0 { 0.0 } else { greatest }])
}

fn footer(columns: &[Column<'_>], rows: usize, groups: &[Vec<Chunk<'_>>], texts: &[(&str, &str)]) -> Vec<u8> {
    let mut out = Vec::new();
    let elements: Vec<Option<&str>> =
        std::iter::once(None).chain(columns.iter().map(|(name, _)| Some(*name))).collect();
    Struct::write(&mut out, |file| {
        file.int(1, 1);
        file.structs(2, &elements, |element, name| match name {
            None => {
                element.binary(4, b"root");
                element.int(5, columns.len() as i32);
            }
            Some(name) => {
                element.int(1, DOUBLE);
                element.int(3, REQUIRED);
                element.binary(4, name.as_bytes());
            }
        });
        file.long(3, rows);
        file.structs(4, groups, |group, chunks| {
            group.structs(1, chunks, chunk_fields);
            group.long(2, chunks.iter().map(|chunk| chunk.size).sum());
            group.long(3, chunks.first().map_or(0, |chunk| chunk.rows));
        });
        if !texts.is_empty() {
            file.structs(5, texts, |pair, (key, value)| {
                pair.binary(1, key.as_bytes());
                pair.binary(2, value.as_bytes());
            });
        }
        file.binary(6, concat!("pneudrive ", env!("CARGO_PKG_VERSION")).as_bytes());
        file.structs(7, columns, |order, _| order.inner(1, |_| ()));
    });
    out
}

fn chunk_fields(column: &mut Struct<'_>, chunk: &Chunk<'_>) {
    column.long(2, 0);
    column.inner(3, |about| {
        about.int(1, DOUBLE);
        about.ints(2, &[PLAIN]);
        about.texts(3, &[chunk.name]);
        about.int(4, UNCOMPRESSED);
        about.long(5, chunk.rows);
        about.long(6, chunk.size);
        about.long(7, chunk.size);
        about.long(9, chunk.begin);
        about.inner(12, |statistics| {
            statistics.long(3, 0);
            if let Some([least, greatest]) = chunk.ends {
                statistics.binary(5, &greatest.to_le_bytes());
                statistics.binary(6, &least.to_le_bytes());
                statistics.yes(7);
                statistics.yes(8);
            }
        });
    });
}

/// Types of fields and of items of a list in the compact protocol of Thrift.
const TRUE: u8 = 1;
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A struct that is being written; its fields come in the order of their numbers.
struct Struct<'a> {
    out: &'a mut Vec<u8>,
    last: u8,
}

impl<'a> Struct<'a> {
    /// Writes a struct and its end.
    fn write(out: &'a mut Vec<u8>, fields: impl FnOnce(&mut Struct<'_>)) {
        let mut own = Struct { out, last: 0 };
        fields(&mut own);
        own.out.push(0);
    }

    fn field(&mut self, number: u8, kind: u8) {
        debug_assert!(number > self.last && number - self.last < 16, "fields come in order");
        self.out.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    fn int(&mut self, number: u8, value: i32) {
        self.field(number, I32);
        varint(self.out, zigzag(value.into()));
    }

    fn long(&mut self, number: u8, value: usize) {
        self.field(number, I64);
        varint(self.out, zigzag(value as i64));
    }

    fn yes(&mut self, number: u8) {
        self.field(number, TRUE);
    }

    fn binary(&mut self, number: u8, value: &[u8]) {
        self.field(number, BINARY);
        bytes(self.out, value);
    }

    fn inner(&mut self, number: u8, fields: impl FnOnce(&mut Struct<'_>)) {
        self.field(number, STRUCT);
        Struct::write(self.out, fields);
    }

    fn ints(&mut self, number: u8, values: &[i32]) {
        self.list(number, I32, values.len());
        for value in values {
            varint(self.out, zigzag((*value).into()));
        }
    }

    fn texts(&mut self, number: u8, values: &[&str]) {
        self.list(number, BINARY, values.len());
        for value in values {
            bytes(self.out, value.as_bytes());
        }
    }

    fn structs<T>(&mut self, number: u8, items: &[T], mut fields: impl FnMut(&mut Struct<'_>, &T)) {
        self.list(number, STRUCT, items.len());
        for item in items {
            Struct::write(self.out, |one| fields(one, item));
        }
    }

    fn list(&mut self, number: u8, kind: u8, length: usize) {
        self.field(number, LIST);
        if length < 15 {
            self.out.push((length as u8) << 4 | kind);
        } else {
            self.out.push(0xF0 | kind);
            varint(self.out, length as u64);
        }
    }
}

fn bytes(out: &mut Vec<u8>, value: &[u8]) {
    varint(out, value.len() as u64);
    out.extend_from_slice(value);
}

fn zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63) as u64
}

/// Writes a number with seven bits in each byte, the lowest first.
fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
