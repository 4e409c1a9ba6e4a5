//! Reads from a SPIR-V module how its structs lie in memory: the little that the layout test needs.

use std::collections::BTreeMap;

/// A struct that a shader reads from memory.
#[derive(Debug, Default)]
pub struct MemoryStruct {
    pub name: String,
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
const OP_TYPE_RUNTIME_ARRAY: u32 = 29;
const OP_TYPE_STRUCT: u32 = 30;
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
    /// Types of the members of each struct.
    structs: Vec<(u32, Vec<u32>)>,
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
    let in_memory = ids.structs.iter().filter(|(id, _)| ids.offsets.contains_key(&(*id, 0)));
    in_memory.map(|(id, types)| ids.memory_struct(*id, types)).collect()
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
            (OP_TYPE_RUNTIME_ARRAY, [id, element]) => {
                self.kinds.insert(*id, format!("{}[]", self.kind(*element)));
                self.element_strides.extend(self.strides.get(id).map(|stride| (*element, *stride)));
            }
            (OP_TYPE_STRUCT, [id, types @ ..]) => {
                self.kinds.insert(*id, self.names.get(id).cloned().unwrap_or_default());
                self.structs.push((*id, types.to_vec()));
            }
            _ => {}
        }
    }

    fn kind(&self, id: u32) -> String {
        self.kinds.get(&id).cloned().unwrap_or_else(|| format!("type {id}"))
    }

    fn memory_struct(&self, id: u32, types: &[u32]) -> MemoryStruct {
        let member = |(place, kind): (u32, &u32)| Member {
            name: self.member_names.get(&(id, place)).cloned().unwrap_or_default(),
            offset: self.offsets[&(id, place)],
            kind: self.kind(*kind),
        };
        MemoryStruct {
            name: self.kind(id),
            members: (0..).zip(types).map(member).collect(),
            array_stride: self.element_strides.get(&id).copied(),
        }
    }
}

/// A string of SPIR-V: UTF-8 in words, lowest byte first, ended by a zero.
fn text(words: &[u32]) -> String {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0).collect();
    String::from_utf8(bytes).expect("names in SPIR-V are UTF-8")
}
