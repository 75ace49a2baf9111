import pytest


@pytest.fixture(params=["ball_in_cup", "finger", "stacker"])
def name(request):
    return request.param
