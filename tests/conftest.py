import pytest

import passpmp_ti as pti


@pytest.fixture(scope="session", autouse=True)
def kernels():
    """Taichi is initialised once a session."""
    pti.init("cpu")
