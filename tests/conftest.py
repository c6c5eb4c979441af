import os

import pytest

import passpmp_ti as pti


@pytest.fixture(scope="session", autouse=True)
def kernels():
    """Taichi is initialised once a session; PASSPMP_DEBUG=1 checks every index in the kernels."""
    pti.init("cpu", debug=bool(os.environ.get("PASSPMP_DEBUG")))
