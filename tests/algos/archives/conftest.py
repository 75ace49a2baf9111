import pytest


@pytest.fixture(autouse=True, scope="package")
def small_blocks():
    """Archives grow block by block in these tests, though they hold few elites."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("curiosity_algos.archives.store.BLOCK_BYTES", 512)
        yield
