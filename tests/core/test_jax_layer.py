"""The layer for JAX: its gradients by JAX's own check, jit and vmap, and what it says of misuse."""

import re
from pathlib import Path

import numpy as np
import pytest

import hqp_rp

jax = pytest.importorskip("jax", reason="jax is not installed: pip install jax")

import jax.numpy as jnp  # noqa: E402
from jax.test_util import check_grads  # noqa: E402

from hqp_rp.core import jax_layer  # noqa: E402

EXACT = "hierarchical_active_set"
PAGE = Path(__file__).parents[2] / "docs" / "derivative.md"


@pytest.fixture(autouse=True)
def double():
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


def arrays():
    rng = np.random.default_rng(0)
    return tuple(jnp.asarray(rng.standard_normal(shape)) for shape in [(3, 7), (3,), (2, 7), (2,), (7,), (7, 7)])


def answer(A1, b1, A2, low, zeta, root):
    W = jnp.eye(7) + root @ root.T
    levels = [(A1, b1), (A2, low, low + 0.5)]
    return jax_layer.solve(levels, EXACT, hard=(jnp.eye(7), -0.6, 0.6), secondary=zeta, metric=W)


def test_gradients():
    x = answer(*arrays())
    assert bool((jnp.abs(x) > 0.6 - 1e-9).any())
    check_grads(answer, arrays(), order=1, modes=["rev"])


def test_equalities_are_the_library_s():
    A1, b1, A2, b2, *_ = arrays()
    problem = hqp_rp.Problem([hqp_rp.Level.equality(A1, b1), hqp_rp.Level.equality(A2, b2)])

    def plain(*data):
        return jax_layer.solve([data[:2], data[2:]], "null_space")

    solution = hqp_rp.solve(problem, "null_space")
    np.testing.assert_array_equal(plain(A1, b1, A2, b2), solution.x)
    found = jax.grad(lambda *data: plain(*data)[0], argnums=(0, 1, 2, 3))(A1, b1, A2, b2)
    expected = hqp_rp.vjp(problem, solution, np.eye(7)[0])
    np.testing.assert_allclose(np.concatenate((found[0], found[2])), expected.matrix, atol=1e-14)
    np.testing.assert_allclose(np.concatenate((found[1], found[3])), expected.rhs, atol=1e-14)


def test_jit_and_vmap():
    A1, b1, A2, low, zeta, root = arrays()
    lows = jnp.stack([low, low + 0.1, low - 0.3])
    many = jax.jit(jax.vmap(answer, in_axes=(None, None, None, 0, None, None)))
    each = [answer(A1, b1, A2, l, zeta, root) for l in lows]
    np.testing.assert_allclose(many(A1, b1, A2, lows, zeta, root), each, atol=1e-13)

    def loss(A2, lows):
        return jnp.sum(many(A1, b1, A2, lows, zeta, root) ** 2)

    def one(A2, l):
        return jnp.sum(answer(A1, b1, A2, l, zeta, root) ** 2)

    found = jax.jit(jax.grad(loss, argnums=(0, 1)))(A2, lows)
    each = [jax.grad(one, argnums=(0, 1))(A2, l) for l in lows]
    np.testing.assert_allclose(found[0], sum(first for first, _ in each), atol=1e-12)
    np.testing.assert_allclose(found[1], [second for _, second in each], atol=1e-12)


def test_single_precision_stays_single():
    jax.config.update("jax_enable_x64", False)
    A, b = jnp.eye(2, 3), jnp.ones(2)
    gradient = jax.grad(lambda b: jax_layer.solve([(A, b)], "null_space")[1])(b)
    assert gradient.dtype == jnp.float32
    np.testing.assert_array_equal(gradient, [0.0, 1.0])


def test_misuse():
    A1, b1, A2, b2, *_ = arrays()
    with pytest.raises(hqp_rp.ProblemError, match="levels is empty"):
        jax_layer.solve([], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match=r"levels\[0\] is ArrayImpl; it must be \(A, b\)"):
        jax_layer.solve([A1], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match=r"levels\[1\]: A has shape \(2, 6\); it must be \(m, 7\)"):
        jax_layer.solve([(A1, b1), (A2[:, :6], b2)], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match=r"levels\[0\]: a bound has shape \(2,\); it must be \(3,\)"):
        jax_layer.solve([(A1, b2)], EXACT)
    with pytest.raises(hqp_rp.ProblemError, match=r"metric has shape \(3,\); it must be \(7, 7\)"):
        jax_layer.solve([(A1, b1)], EXACT, metric=b1)


def test_what_has_no_derivative_ends_with_the_sentence():
    A, b = jnp.eye(1, 2), jnp.ones(1)
    with pytest.raises(Exception, match="The rank of level 'level 2' is 0 beside the levels before it"):
        jax.grad(lambda b: jax_layer.solve([(A, b), (A, 2.0 * b)], "null_space")[0])(b)
    found = jax.grad(lambda b: jax_layer.solve([(A, b), (A, 2.0 * b)], "null_space", constant_rank=True)[0])(b)
    np.testing.assert_array_equal(found, [1.0])


def test_the_page_s_code_runs():
    blocks = re.findall(r"^```py\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    jax_blocks = [code for code in blocks if "import jax" in code]
    assert jax_blocks
    for code in jax_blocks:
        exec(compile(code, str(PAGE), "exec"), {})
