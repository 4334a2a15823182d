"""ASVS 5, 8.2: pages' files of the login page alone are served without a login."""

import http.client

import pytest

from tests.faults.victim import Victim


@pytest.mark.parametrize("path", ["/static/login/..%2fapp.js", "/static/login/../app.js", "/static/login/%2e%2e/app.js", "/static/login//../app.js", "/static/login/..%5capp.js"])  # fmt: skip
def test_no_path_leads_out_of_the_folders_that_are_open(victim: Victim, path: str) -> None:
    connection = http.client.HTTPConnection(victim.base.removeprefix("http://"), timeout=10)
    connection.putrequest("GET", path)
    connection.endheaders()
    assert connection.getresponse().status in (401, 404)
    connection.close()


def test_the_login_page_is_open(victim: Victim) -> None:
    connection = http.client.HTTPConnection(victim.base.removeprefix("http://"), timeout=10)
    for path in ("/login", "/static/colors.css"):
        connection.request("GET", path)
        answer = connection.getresponse()
        answer.read()
        assert answer.status == 200
    connection.close()
