"""The page of the list of loops, as a spreadsheet has it."""


def test_the_loop_list_is_set_and_says_what_could_not_be(client):
    listed = b"tag;importance;P&ID\nFIC101;2,5;a<b>\nNO<b>WHERE;1;x\n"
    answer = client.post("/loop-list", files={"file": ("loops.csv", listed, "text/csv")})
    assert answer.status_code == 200
    assert "1 loop changed, 0 as before, 1 refused" in answer.text
    assert "NO&lt;b&gt;WHERE" in answer.text
    assert client.get("/v1/loops/FIC101").json()["importance"] == 2.5
    client.patch("/v1/loops/FIC101", json={"importance": 1})
    for files in ({"other": ("a.csv", b"", "text/csv")}, {"file": ("a.csv", b"tag\n", "text/csv")}):
        refused = client.post("/loop-list", files=files, headers={"Accept": "text/html"})
        assert refused.status_code in (400, 422)
        assert "<h1>" in refused.text
