//! The compact protocol of Thrift, in which Parquet writes its headers: only what those need.

/// Types of fields and of items of a list.
const TRUE: u8 = 1;
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A struct that is being written; its fields come in the order of their numbers.
pub struct Struct<'a> {
    out: &'a mut Vec<u8>,
    last: u8,
}

impl<'a> Struct<'a> {
    /// Writes a struct and its end.
    pub fn write(out: &'a mut Vec<u8>, fields: impl FnOnce(&mut Struct<'_>)) {
        let mut own = Struct { out, last: 0 };
        fields(&mut own);
        own.out.push(0);
    }

    fn field(&mut self, number: u8, kind: u8) {
        debug_assert!(number > self.last && number - self.last < 16, "fields come in order");
        self.out.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    pub fn int(&mut self, number: u8, value: i32) {
        self.field(number, I32);
        varint(self.out, zigzag(value.into()));
    }

    pub fn long(&mut self, number: u8, value: usize) {
        self.field(number, I64);
        varint(self.out, zigzag(value as i64));
    }

    pub fn yes(&mut self, number: u8) {
        self.field(number, TRUE);
    }

    pub fn binary(&mut self, number: u8, value: &[u8]) {
        self.field(number, BINARY);
        bytes(self.out, value);
    }

    pub fn inner(&mut self, number: u8, fields: impl FnOnce(&mut Struct<'_>)) {
        self.field(number, STRUCT);
        Struct::write(self.out, fields);
    }

    pub fn ints(&mut self, number: u8, values: &[i32]) {
        self.list(number, I32, values.len());
        for value in values {
            varint(self.out, zigzag((*value).into()));
        }
    }

    pub fn texts(&mut self, number: u8, values: &[&str]) {
        self.list(number, BINARY, values.len());
        for value in values {
            bytes(self.out, value.as_bytes());
        }
    }

    pub fn structs<T>(&mut self, number: u8, items: &[T], mut fields: impl FnMut(&mut Struct<'_>, &T)) {
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

/// Seven bits in each byte, the lowest first.
fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
