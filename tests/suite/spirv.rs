//! Reads from a SPIR-V module how its structs lie in memory: the little that the layout test needs.

use std::collections::{BTreeMap, BTreeSet};

/// A struct that a shader reads from memory, and that is not a member of another one.
#[derive(Debug, Default)]
pub struct MemoryStruct {
    pub name: String,
    /// A member that is a struct or an array of a fixed length stands here as all that it is made of: `classes[1].end`.
    pub members: Vec<Member>,
    /// Distance of two elements in bytes, if the struct is the element of an array.
    pub array_stride: Option<u32>,
}

/// One member of a struct.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Member {
    pub name: String,
    pub offset: u32,
    /// The type as GLSL writes it: `uint`, `vec2`, `Tile[]`.
    pub kind: String,
}

// Operations and decorations by the numbers of the SPIR-V specification, sections 3.49 and 3.20.
const OP_NAME: u32 = 5;
const OP_MEMBER_NAME: u32 = 6;
const OP_TYPE_INT: u32 = 21;
const OP_TYPE_FLOAT: u32 = 22;
const OP_TYPE_VECTOR: u32 = 23;
const OP_TYPE_ARRAY: u32 = 28;
const OP_TYPE_RUNTIME_ARRAY: u32 = 29;
const OP_TYPE_STRUCT: u32 = 30;
const OP_CONSTANT: u32 = 43;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const ARRAY_STRIDE: u32 = 6;
const OFFSET: u32 = 35;

const WORDS_OF_HEADER: usize = 5;

/// What the module says of its ids. Names and decorations come before the types that they are about.
#[derive(Default)]
struct Ids {
    names: BTreeMap<u32, String>,
    member_names: BTreeMap<(u32, u32), String>,
    offsets: BTreeMap<(u32, u32), u32>,
    strides: BTreeMap<u32, u32>,
    /// How GLSL writes each type.
    kinds: BTreeMap<u32, String>,
    /// Strides of arrays by the id of their element.
    element_strides: BTreeMap<u32, u32>,
    /// Constants of 32 bits: lengths of arrays are among them.
    constants: BTreeMap<u32, u32>,
    /// Element and length of each array of a fixed length.
    arrays: BTreeMap<u32, (u32, u32)>,
    /// Types of the members of each struct.
    structs: BTreeMap<u32, Vec<u32>>,
}

/// The structs of a module whose members have offsets, in the module's order. A struct that a shader only keeps in
/// registers has none.
pub fn memory_structs(module: &[u8]) -> Vec<MemoryStruct> {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(module);
    let mut ids = Ids::default();
    let mut rest = &words[WORDS_OF_HEADER..];
    while let Some(&first) = rest.first() {
        let (operation, after) = rest.split_at((first >> 16) as usize);
        ids.note(first & 0xFFFF, &operation[1..]);
        rest = after;
    }
    let elements = ids.arrays.values().map(|(element, _)| element);
    let inner: BTreeSet<&u32> = ids.structs.values().flatten().chain(elements).collect();
    let in_memory = ids.structs.keys().filter(|id| ids.offsets.contains_key(&(**id, 0)) && !inner.contains(id));
    in_memory.map(|id| ids.memory_struct(*id)).collect()
}

impl Ids {
    fn note(&mut self, operation: u32, operands: &[u32]) {
        match (operation, operands) {
            (OP_NAME, [id, name @ ..]) => {
                self.names.insert(*id, text(name));
            }
            (OP_MEMBER_NAME, [id, member, name @ ..]) => {
                self.member_names.insert((*id, *member), text(name));
            }
            (OP_DECORATE, [id, ARRAY_STRIDE, stride]) => {
                self.strides.insert(*id, *stride);
            }
            (OP_MEMBER_DECORATE, [id, member, OFFSET, offset]) => {
                self.offsets.insert((*id, *member), *offset);
            }
            (OP_TYPE_INT, [id, 32, signed]) => {
                self.kinds.insert(*id, if *signed == 0 { "uint" } else { "int" }.to_owned());
            }
            (OP_TYPE_FLOAT, [id, 32]) => {
                self.kinds.insert(*id, "float".to_owned());
            }
            (OP_TYPE_VECTOR, [id, component, count]) => {
                let prefix = match self.kind(*component).as_str() {
                    "uint" => "u",
                    "int" => "i",
                    _ => "",
                };
                self.kinds.insert(*id, format!("{prefix}vec{count}"));
            }
            (OP_CONSTANT, [_, id, value]) => {
                self.constants.insert(*id, *value);
            }
            (OP_TYPE_ARRAY, [id, element, length]) => {
                // A length by specialisation is no constant; such arrays are not in memory.
                self.arrays.extend(self.constants.get(length).map(|length| (*id, (*element, *length))));
            }
            (OP_TYPE_RUNTIME_ARRAY, [id, element]) => {
                self.kinds.insert(*id, format!("{}[]", self.kind(*element)));
                self.element_strides.extend(self.strides.get(id).map(|stride| (*element, *stride)));
            }
            (OP_TYPE_STRUCT, [id, types @ ..]) => {
                self.kinds.insert(*id, self.names.get(id).cloned().unwrap_or_default());
                self.structs.insert(*id, types.to_vec());
            }
            _ => {}
        }
    }

    fn kind(&self, id: u32) -> String {
        self.kinds.get(&id).cloned().unwrap_or_else(|| format!("type {id}"))
    }

    fn memory_struct(&self, id: u32) -> MemoryStruct {
        let mut members = Vec::new();
        self.list_members(id, (String::new(), 0), &mut members);
        MemoryStruct { name: self.kind(id), members, array_stride: self.element_strides.get(&id).copied() }
    }

    /// Lists the members of a struct that lies at an offset under a path.
    fn list_members(&self, id: u32, (path, start): (String, u32), members: &mut Vec<Member>) {
        for (place, kind) in (0..).zip(&self.structs[&id]) {
            let name = self.member_names.get(&(id, place)).map_or("", String::as_str);
            self.list_member(*kind, (format!("{path}{name}"), start + self.offsets[&(id, place)]), members);
        }
    }

    fn list_member(&self, kind: u32, (name, offset): (String, u32), members: &mut Vec<Member>) {
        if let Some(&(element, length)) = self.arrays.get(&kind) {
            for place in 0..length {
                let at = offset + place * self.strides[&kind];
                self.list_member(element, (format!("{name}[{place}]"), at), members);
            }
        } else if self.structs.contains_key(&kind) {
            self.list_members(kind, (format!("{name}."), offset), members);
        } else {
            members.push(Member { name, offset, kind: self.kind(kind) });
        }
    }
}

/// A string of SPIR-V: UTF-8 in words, lowest byte first, ended by a zero.
fn text(words: &[u32]) -> String {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0).collect();
    String::from_utf8(bytes).expect("names in SPIR-V are UTF-8")
}
