"""Layers of LSTM cells as a bundle holds them: the two matrices side by side [4 W, 2 W] (gates i, f, g, o), one bias."""
import torch


def packed(lstm, layer=0):
    """Weight and bias of a layer of an `nn.LSTM` whose input is as wide as its cells."""
    get = lambda name: getattr(lstm, f"{name}_l{layer}").detach().float()
    return torch.cat([get("weight_ih"), get("weight_hh")], 1), get("bias_ih") + get("bias_hh")


def unpacked(weight, bias, layer=0):
    """The inverse: the layer's part of an `nn.LSTM`'s state."""
    weight, bias = weight.float(), bias.float()
    ih, hh = weight.split(weight.shape[1] // 2, 1)
    return {f"{name}_l{layer}": value for name, value in (("weight_ih", ih), ("weight_hh", hh), ("bias_ih", bias), ("bias_hh", torch.zeros_like(bias)))}
