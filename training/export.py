"""Weights to the file that crates/prior reads.  python export.py WEIGHTS OUT_DIR

prior.safetensors: the weights of each convolution as f16 with its batch norm folded in, its bias as f32, in
PyTorch's order of axes; named as in model.py.
"""
import os, sys
import numpy as np
from safetensors.numpy import save_file

EPSILON = 1e-5  # PyTorch's batch norm
NORMS = {'0': '1', 'b': 'n', 'c': 'n'}  # the last part of a convolution's name: that of its norm
ROOTS = {'enc': 'encoder', 'vol': 'volume'}
HEADS = ('aux', 'coarse')  # only trained with


def folded(state):
    """state: name -> array; the convolutions' weights and biases by name"""
    out = {}
    for key, value in state.items():
        if not key.endswith('.weight') or value.ndim < 3:
            continue
        path = key[:-len('.weight')]
        if path.rsplit('.', 1)[-1] in HEADS:
            continue
        # A transposed convolution has its inputs first.
        transposed = path.endswith('.c')
        weight = value.astype(np.float32)
        bias = state.get(path + '.bias')
        bias = np.zeros(weight.shape[1 if transposed else 0]) if bias is None else bias
        bias = bias.astype(np.float32)
        parent, last = path.rsplit('.', 1)
        norm = f'{parent}.{NORMS.get(last, "")}'
        if norm + '.running_mean' in state:
            part = {name: state[f'{norm}.{name}'].astype(np.float32) for name in ('weight', 'bias', 'running_mean', 'running_var')}
            scale = part['weight'] / np.sqrt(part['running_var'] + EPSILON)
            axis = 1 if transposed else 0
            weight = weight * scale.reshape([-1 if i == axis else 1 for i in range(weight.ndim)])
            bias = (bias - part['running_mean']) * scale + part['bias']
        name = path.removesuffix('.0') if last == '0' else path
        root, rest = name.split('.', 1)
        # In C order: safetensors writes the memory as it is, whatever the strides (channels last) say.
        out[f'{ROOTS[root]}.{rest}.weight'] = np.ascontiguousarray(weight.astype(np.float16))
        out[f'{ROOTS[root]}.{rest}.bias'] = bias.astype(np.float32)
    return out


def main():
    import torch
    weights, out = sys.argv[1:3]
    os.makedirs(out, exist_ok=True)
    state = torch.load(weights, map_location='cpu')
    tensors = folded({key: value.float().numpy() for key, value in state.items()})
    path = f'{out}/prior.safetensors'
    save_file(tensors, path)
    print(os.path.basename(path), os.path.getsize(path), 'bytes', len(tensors), 'tensors')


if __name__ == '__main__':
    main()
