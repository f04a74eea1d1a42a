"""Weights to the two graphs that crates/prior reads.  python export.py WEIGHTS OUT_DIR

encoder.onnx and volume.onnx, opset 13, batch norm folded into the convolutions, convolutions' weights as f16
that the graph casts to f32.
"""
import inspect, os, sys
import numpy as np, onnx, torch
from onnx import TensorProto, helper, numpy_helper
import model


def halved(path):
    """stores initialisers of more than one axis as f16"""
    graph = onnx.load(path)
    casts = []
    for tensor in graph.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT and len(tensor.dims) > 1:
            name = tensor.name
            tensor.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float16), name + '.f16'))
            casts.append(helper.make_node('Cast', [name + '.f16'], [name], to=TensorProto.FLOAT))
    for node in reversed(casts):
        graph.graph.node.insert(0, node)
    onnx.checker.check_model(graph)
    onnx.save(graph, path)
    print(os.path.basename(path), os.path.getsize(path), 'bytes', sorted({n.op_type for n in graph.graph.node}))


def main():
    weights, out = sys.argv[1:3]
    os.makedirs(out, exist_ok=True)
    net = model.Prior()
    state = torch.load(weights, map_location='cpu')
    net.load_state_dict({k: v.float() if v.is_floating_point() else v for k, v in state.items()})
    net.eval()
    n, nz, ny, nx, nw = 3, 32, 16, 24, 32
    drawings = torch.rand(n, 2, nz * 4, nw * 4)
    features, position, extra = torch.randn(n, 24, ny, nx, nz), torch.randn(n, 4, ny, nx, 1), torch.rand(1, 16, ny, nx, nz)
    options = dict(opset_version=13, do_constant_folding=True)
    if 'dynamo' in inspect.signature(torch.onnx.export).parameters:
        options['dynamo'] = False
    space = {2: 'y', 3: 'x', 4: 'z'}
    torch.onnx.export(net.enc, (drawings,), out + '/encoder.onnx', input_names=['drawings'], output_names=['features'],
                      dynamic_axes={'drawings': {0: 'n', 2: 'h', 3: 'w'}, 'features': {0: 'n', 2: 'nz', 3: 'nw'}}, **options)
    torch.onnx.export(net.vol, (features, position, extra), out + '/volume.onnx', input_names=['features', 'position', 'extra'], output_names=['logits'],
                      dynamic_axes={'features': {0: 'n', **space}, 'position': {0: 'n', 2: 'y', 3: 'x'}, 'extra': space, 'logits': space}, **options)
    for name in ('encoder', 'volume'):
        halved(f'{out}/{name}.onnx')


if __name__ == '__main__':
    main()
