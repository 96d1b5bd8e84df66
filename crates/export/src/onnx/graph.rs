//! Building a graph one operator at a time; values are columns, `(N x 1)`, or blocks of them.

use super::proto::{Attribute, Dimension, Graph, Node, Shape, Tensor, TensorType, Type, ValueInfo};

/// The name of a value in the graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Value(String);

/// A graph that grows.
#[derive(Debug, Default)]
pub struct Builder {
    graph: Graph,
}

impl Builder {
    /// An input of `width` columns.
    pub fn input(&mut self, name: &str, width: usize, meaning: &str) -> Value {
        self.graph.inputs.push(info(name, width, meaning));
        Value(name.to_owned())
    }

    /// Makes a value an output of `width` columns.
    pub fn output(&mut self, value: &Value, name: &str, width: usize, meaning: &str) {
        self.push("Identity", &[value], &[], name.to_owned());
        self.graph.outputs.push(info(name, width, meaning));
    }

    /// The graph under this name.
    pub fn finish(self, name: &str) -> Graph {
        Graph { name: name.to_owned(), ..self.graph }
    }

    fn push(&mut self, op: &str, inputs: &[&Value], attributes: &[(&str, i64)], output: String) -> Value {
        let attributes = attributes.iter().map(|&(name, value)| Attribute {
            name: name.to_owned(),
            i: Some(value),
            kind: Attribute::INT,
        });
        self.graph.nodes.push(Node {
            inputs: inputs.iter().map(|value| value.0.clone()).collect(),
            outputs: vec![output.clone()],
            name: format!("{op}_{}", self.graph.nodes.len()),
            op_type: op.to_owned(),
            attributes: attributes.collect(),
        });
        Value(output)
    }

    /// The result of one of ONNX's operators.
    pub fn op(&mut self, op: &str, inputs: &[&Value], attributes: &[(&str, i64)]) -> Value {
        let output = format!("v{}", self.graph.nodes.len());
        self.push(op, inputs, attributes, output)
    }

    fn initializer(&mut self, data_type: i32, dims: &[usize], raw_data: Vec<u8>) -> Value {
        let dims: Vec<i64> = dims.iter().map(|&dim| dim as i64).collect();
        let same = |own: &&Tensor| own.data_type == data_type && own.dims == dims && own.raw_data == raw_data;
        if let Some(known) = self.graph.initializers.iter().find(same) {
            return Value(known.name.clone());
        }
        let name = format!("c{}", self.graph.initializers.len());
        self.graph.initializers.push(Tensor { dims, data_type, name: name.clone(), raw_data });
        Value(name)
    }

    /// Constant numbers of this shape.
    pub fn tensor(&mut self, dims: &[usize], values: &[f32]) -> Value {
        self.initializer(Tensor::FLOAT, dims, values.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    /// One constant number.
    pub fn number(&mut self, value: f32) -> Value {
        self.tensor(&[], &[value])
    }

    fn whole(&mut self, dims: &[usize], values: &[i64]) -> Value {
        self.initializer(Tensor::INT64, dims, values.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    /// a + b
    pub fn add(&mut self, a: &Value, b: &Value) -> Value {
        self.op("Add", &[a, b], &[])
    }

    /// a - b
    pub fn sub(&mut self, a: &Value, b: &Value) -> Value {
        self.op("Sub", &[a, b], &[])
    }

    /// a b
    pub fn mul(&mut self, a: &Value, b: &Value) -> Value {
        self.op("Mul", &[a, b], &[])
    }

    /// a / b
    pub fn div(&mut self, a: &Value, b: &Value) -> Value {
        self.op("Div", &[a, b], &[])
    }

    /// value + number
    pub fn plus(&mut self, value: &Value, number: f32) -> Value {
        let number = self.number(number);
        self.add(value, &number)
    }

    /// value times number
    pub fn times(&mut self, value: &Value, number: f32) -> Value {
        let number = self.number(number);
        self.mul(value, &number)
    }

    /// Whether value < number.
    pub fn is_below(&mut self, value: &Value, number: f32) -> Value {
        let number = self.number(number);
        self.op("Less", &[value, &number], &[])
    }

    /// `yes` where the condition holds, else `no`.
    pub fn choose(&mut self, condition: &Value, yes: &Value, no: &Value) -> Value {
        self.op("Where", &[condition, yes, no], &[])
    }

    /// One of two numbers.
    pub fn choose_number(&mut self, condition: &Value, yes: f32, no: f32) -> Value {
        let (yes, no) = (self.number(yes), self.number(no));
        self.choose(condition, &yes, &no)
    }

    /// The value within limits.
    pub fn clip(&mut self, value: &Value, [low, high]: [f32; 2]) -> Value {
        let (low, high) = (self.number(low), self.number(high));
        self.op("Clip", &[value, &low, &high], &[])
    }

    /// sqrt(a^2 + b^2)
    pub fn hypot(&mut self, a: &Value, b: &Value) -> Value {
        let (a, b) = (self.mul(a, a), self.mul(b, b));
        let sum = self.add(&a, &b);
        self.op("Sqrt", &[&sum], &[])
    }

    /// The angle of the point (x, y), which ONNX has no operator for.
    ///
    /// ```text
    /// atan2(y, x) = atan(y / x) + (0 where x >= 0, pi where x < 0 <= y, -pi where x, y < 0)
    /// ```
    ///
    /// Source: the definition; x = 0 is moved by the least positive number.
    pub fn atan2(&mut self, y: &Value, x: &Value) -> Value {
        let tiny = self.number(f32::MIN_POSITIVE);
        let magnitude = self.op("Abs", &[x], &[]);
        let is_zero = self.op("Less", &[&magnitude, &tiny], &[]);
        let x = self.choose(&is_zero, &tiny, x);
        let ratio = self.div(y, &x);
        let angle = self.op("Atan", &[&ratio], &[]);
        let (is_behind, is_negative) = (self.is_below(&x, 0.0), self.is_below(y, 0.0));
        let turn = self.choose_number(&is_negative, -std::f32::consts::PI, std::f32::consts::PI);
        let zero = self.number(0.0);
        let turn = self.choose(&is_behind, &turn, &zero);
        self.add(&angle, &turn)
    }

    /// Columns of a block, in this order.
    pub fn columns(&mut self, block: &Value, indices: &[usize]) -> Value {
        let indices: Vec<i64> = indices.iter().map(|&index| index as i64).collect();
        let indices = self.whole(&[indices.len()], &indices);
        self.op("Gather", &[block, &indices], &[("axis", 1)])
    }

    /// Blocks side by side.
    pub fn side_by_side(&mut self, blocks: &[Value]) -> Value {
        self.op("Concat", &blocks.iter().collect::<Vec<_>>(), &[("axis", 1)])
    }

    /// Entries of a constant row at places that are whole numbers, modulo its length.
    pub fn look_up(&mut self, row: &[f32], places: &Value) -> Value {
        let (row_values, len) = (self.tensor(&[row.len()], row), self.whole(&[], &[row.len() as i64]));
        let places = self.op("Cast", &[places], &[("to", i64::from(Tensor::INT64))]);
        let places = self.op("Mod", &[&places, &len], &[]);
        self.op("Gather", &[&row_values, &places], &[("axis", 0)])
    }

    /// Whether any column holds something that is no number, `(N x 1)`.
    pub fn any_nan(&mut self, block: &Value) -> Value {
        let is_nan = self.op("IsNaN", &[block], &[]);
        let count = self.op("Cast", &[&is_nan], &[("to", i64::from(Tensor::FLOAT))]);
        let axis = self.whole(&[1], &[1]);
        let count = self.op("ReduceSum", &[&count, &axis], &[("keepdims", 1)]);
        let half = self.number(0.5);
        self.op("Greater", &[&count, &half], &[])
    }
}

/// A block of `width` columns for any number of control steps.
fn info(name: &str, width: usize, meaning: &str) -> ValueInfo {
    let dims = vec![
        Dimension { value: None, parameter: Some("N".to_owned()) },
        Dimension { value: Some(width as i64), parameter: None },
    ];
    let tensor = TensorType { elem_type: Tensor::FLOAT, shape: Some(Shape { dims }) };
    ValueInfo { name: name.to_owned(), kind: Some(Type { tensor: Some(tensor) }), doc_string: meaning.to_owned() }
}
