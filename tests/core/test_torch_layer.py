"""The layer for PyTorch: its gradients by torch's own check, batches, and what it says of misuse."""

import re
from pathlib import Path

import numpy as np
import pytest

import hqp_rp

torch = pytest.importorskip("torch", reason="torch is not installed: pip install torch")

from hqp_rp.core import torch_layer  # noqa: E402

EXACT = "hierarchical_active_set"
PAGE = Path(__file__).parents[2] / "docs" / "derivative.md"


def tensor(*shape, seed=0):
    values = np.random.default_rng(seed).standard_normal(shape)
    return torch.tensor(values, dtype=torch.float64, requires_grad=True)


def test_equalities_by_gradcheck():
    data = tensor(3, 7), tensor(3, seed=1), tensor(2, 7, seed=2), tensor(2, seed=3)

    def answer(A1, b1, A2, b2):
        return torch_layer.solve([(A1, b1), (A2, b2)], "null_space")

    assert torch.autograd.gradcheck(answer, data)
    problem = hqp_rp.Problem([hqp_rp.Level.equality(*(t.detach().numpy() for t in data[k : k + 2])) for k in (0, 2)])
    np.testing.assert_array_equal(answer(*data).detach().numpy(), hqp_rp.solve(problem, "null_space").x)


def test_a_batch_with_limits_a_secondary_vector_and_a_metric_by_gradcheck():
    A1, b1, A2 = tensor(3, 5), tensor(2, 1, 3, seed=1), tensor(4, 2, 5, seed=2)
    low, size = tensor(4, 2, seed=3), torch.full((5,), 0.6, dtype=torch.float64, requires_grad=True)
    root, zeta = tensor(5, 5, seed=4), tensor(5, seed=5)

    def answer(A1, b1, A2, low, size, root, zeta):
        W = torch.eye(5, dtype=torch.float64) + root @ root.T
        levels = [(A1, b1), (A2, low, low + 0.5)]
        return torch_layer.solve(levels, EXACT, hard=(torch.eye(5), -size, size), secondary=zeta, metric=W)

    x = answer(A1, b1, A2, low, size, root, zeta)
    assert x.shape == (2, 4, 5)
    assert bool((x.abs() > 0.6 - 1e-9).any())
    assert torch.autograd.gradcheck(answer, (A1, b1, A2, low, size, root, zeta))


def test_bounds_alone_need_no_rank():
    A, b, c = (
        torch.tensor([[1.0, 0.0]]),
        torch.tensor([1.0], requires_grad=True),
        torch.tensor([2.0], requires_grad=True),
    )
    x = torch_layer.solve([(A, b), (A, c)], "null_space")
    assert x.dtype == torch.float32
    (3.0 * x[0]).backward()
    assert (b.grad.item(), c.grad.item()) == (3.0, 0.0)
    with pytest.raises(hqp_rp.NotDifferentiableError, match="The rank of level 'level 2' is 0"):
        torch_layer.solve([(A.requires_grad_(), b), (A, c)], "null_space").sum().backward()


def test_misuse():
    A, b = tensor(2, 3), tensor(2)
    with pytest.raises(hqp_rp.ProblemError, match="levels is empty"):
        torch_layer.solve([], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match=r"levels\[1\] is 1 arrays; it must be \(A, b\) for an equality"):
        torch_layer.solve([(A, b), (A,)], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match=r"levels\[0\]: A has shape \(2,\); it must be a matrix"):
        torch_layer.solve([(b, b)], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match="The arguments of solve do not fit together"):
        torch_layer.solve([(A, tensor(3))], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match="lower must not exceed upper"):
        torch_layer.solve([(A, b, b - 1.0)], EXACT)
    with pytest.raises(hqp_rp.UnknownNameError, match="null_space"):
        torch_layer.solve([(A, b)], "nul_space")
    with pytest.raises(hqp_rp.NoSolutionError, match="contradict"):
        torch_layer.solve([(A, b)], EXACT, hard=(torch.eye(3).repeat(2, 1), torch.arange(6.0)))
    x = torch_layer.solve([(A, b)], EXACT)
    (first,) = torch.autograd.grad((x**2).sum(), b, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        first.sum().backward()


def test_the_page_s_code_runs():
    blocks = re.findall(r"^```py\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    torch_blocks = [code for code in blocks if "import torch" in code]
    assert torch_blocks
    for code in torch_blocks:
        exec(compile(code, str(PAGE), "exec"), {})
