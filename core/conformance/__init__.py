"""The suite that every backend must pass, built in or not: `pytest --pyargs mbexport.core.conformance --backend NAME`.

`checks` is the suite without pytest, `hooks` runs it under pytest, `options` is what pytest finds first.
"""
